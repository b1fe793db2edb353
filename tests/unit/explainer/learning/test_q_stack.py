"""The stack against networks of torch's own, one per agent, on a small world that nobody chose."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch

from webapp.explainer.learning import FreshSettings
from webapp.explainer.learning.q_stack import QStack
from webapp.explainer.learning.threads import one_thread
from webapp.explainer.seeding import stream

SETTINGS = FreshSettings(num_slots=4, units=12, batch_size=6, discount=0.8)
CLIPPING = replace(SETTINGS, max_gradient_norm=0.4)
"""About half of the gradients below are larger than that."""
NUM_STATES, NUM_ACTIONS = 12, 3
STATES = np.arange(NUM_STATES)
OBSERVATIONS = np.concatenate((np.eye(3)[STATES // 4], np.eye(4)[STATES % 4]), axis=1).astype(np.float32)
TERMINAL = STATES >= 9
NEXT_STATE = np.where(
    TERMINAL[:, None], STATES[:, None], stream(0, "world").integers(NUM_STATES, size=(NUM_STATES, NUM_ACTIONS))
).ravel()

Replayed = tuple[np.ndarray, np.ndarray]
"""State-action pairs and rewards, each `[W, B]`."""


@pytest.fixture(autouse=True)
def _as_in_a_run() -> Iterator[None]:
    with one_thread():
        yield


def a_stack(settings: FreshSettings = SETTINGS) -> QStack:
    return QStack(OBSERVATIONS, NEXT_STATE, TERMINAL, settings)


def a_full_stack(settings: FreshSettings = SETTINGS) -> QStack:
    stack = a_stack(settings)
    for slot in range(settings.num_slots):
        stack.admit(slot, stream(slot, "weights"))
    return stack


def replayed(number: int, settings: FreshSettings = SETTINGS) -> Replayed:
    """Draw what each slot replays; a slot's share does not depend on how many slots there are."""
    draws = [stream(number, "replay", str(slot)) for slot in range(settings.num_slots)]
    pairs = [draw.integers(9 * NUM_ACTIONS, size=settings.batch_size, dtype=np.int32) for draw in draws]
    rewards = [draw.normal(size=settings.batch_size).astype(np.float32) for draw in draws]
    return np.stack(pairs), np.stack(rewards)


def all_values(stack: QStack, slots: Sequence[int] = range(4)) -> np.ndarray:
    return np.stack([stack.values(slot).numpy() for slot in slots])


class Alone:
    """One agent's network, target network and optimizer, as one would write them by hand."""

    def __init__(self, rng: np.random.Generator, settings: FreshSettings) -> None:
        self.settings = settings
        first, second, last = (
            torch.nn.Linear(7, settings.units),
            torch.nn.Linear(settings.units, settings.units),
            torch.nn.Linear(settings.units, NUM_ACTIONS),
        )
        with torch.no_grad():
            # Two of seven inputs are 1 at once.
            for layer, fan in ((first, 2), (second, settings.units), (last, settings.units)):
                # A stack holds all layers but the last from inputs to outputs, and so it draws them.
                lies_so = layer is last
                weight, bias = (
                    torch.from_numpy(rng.random(shape, dtype=np.float32) * 2 - 1) / fan**0.5
                    for shape in (layer.weight.shape if lies_so else layer.weight.T.shape, layer.bias.shape)
                )
                layer.weight.copy_(weight if lies_so else weight.T)
                layer.bias.copy_(bias)
        self.network = torch.nn.Sequential(first, torch.nn.ReLU(), second, torch.nn.ReLU(), last)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=settings.learning_rate, fused=False)
        self.renew_target()

    def renew_target(self) -> None:
        self.target = deepcopy(self.network)

    def values(self) -> np.ndarray:
        with torch.no_grad():
            values: np.ndarray = self.network(torch.from_numpy(OBSERVATIONS)).numpy()
        return values

    def update(self, pairs: np.ndarray, rewards: np.ndarray) -> None:
        targets = []
        for pair, reward in zip(pairs.tolist(), rewards.tolist(), strict=True):
            after = NEXT_STATE[pair]
            with torch.no_grad():
                ahead = 0.0 if TERMINAL[after] else float(self.target(torch.from_numpy(OBSERVATIONS[after])).max())
            targets.append(reward + self.settings.discount * ahead)
        taken = self.network(torch.from_numpy(OBSERVATIONS[pairs // NUM_ACTIONS]))[
            range(len(pairs)), pairs % NUM_ACTIONS
        ]
        self.optimizer.zero_grad()
        torch.autograd.backward(torch.nn.functional.smooth_l1_loss(taken, torch.tensor(targets)))
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), self.settings.max_gradient_norm)
        self.optimizer.step()


@pytest.mark.parametrize("settings", [SETTINGS, CLIPPING])
def test_every_agent_learns_as_it_would_from_torch_alone(settings: FreshSettings) -> None:
    stack = a_full_stack(settings)
    agents = [Alone(stream(slot, "weights"), settings) for slot in range(4)]
    for number in range(30):
        pairs, rewards = replayed(number)
        # Only some update, and they have made different numbers of updates, which Adam counts.
        slots = [slot for slot in range(4) if (number + slot) % (slot + 1) == 0]
        stack.update(slots, pairs, rewards)
        for slot in slots:
            agents[slot].update(pairs[slot], rewards[slot])
        if number % 7 == 6:
            stack.renew_target(number % 4)
            agents[number % 4].renew_target()
        expected = np.stack([agent.values() for agent in agents])
        np.testing.assert_allclose(all_values(stack), expected, rtol=1e-4, atol=1e-5)


def test_gradients_are_scaled_down_for_each_agent_by_itself() -> None:
    """Adam forgets a common factor of all gradients, so a large one is followed by a small one."""
    stack, loud = a_full_stack(CLIPPING), a_full_stack(CLIPPING)
    pairs, rewards = replayed(0)
    stack.update(range(4), pairs, rewards)
    loud.update(range(4), pairs, rewards * np.array([[1], [1000], [1], [1]], dtype=np.float32))
    for each in (stack, loud):
        each.update(range(4), pairs, np.zeros_like(rewards))
    np.testing.assert_array_equal(all_values(loud, [0, 2, 3]), all_values(stack, [0, 2, 3]))
    assert not np.array_equal(loud.values(1), stack.values(1))


def test_updates_with_the_target_network_close_behind_lead_to_the_values_of_the_bellman_equation() -> None:
    rewards = stream(0, "rewards").random(NUM_STATES * NUM_ACTIONS, dtype=np.float32)
    exact = np.zeros((NUM_STATES, NUM_ACTIONS))
    for _ in range(200):
        exact = (rewards + 0.8 * np.where(TERMINAL, 0, exact.max(axis=1))[NEXT_STATE]).reshape(exact.shape)
    stack = a_full_stack(replace(SETTINGS, units=48, learning_rate=3e-3))
    pairs = np.tile(np.arange(9 * NUM_ACTIONS, dtype=np.int32), (4, 1))
    for number in range(2500):
        stack.update(range(4), pairs, rewards[pairs])
        if number % 25 == 0:
            for slot in range(4):
                stack.renew_target(slot)
    for slot in range(4):
        np.testing.assert_allclose(stack.values(slot)[:9], exact[:9], atol=0.05)
        np.testing.assert_array_equal(stack.policy(slot)[:9], exact[:9].argmax(axis=1))


def test_a_new_agent_brings_nothing_along_and_disturbs_nobody() -> None:
    stack, undisturbed, new = a_full_stack(), a_full_stack(), a_stack()
    for number in range(5):
        for each in (stack, undisturbed):
            each.update(range(4), *replayed(number))
    for slot in range(4):
        stack.renew_target(slot)
        undisturbed.renew_target(slot)
    for each in (stack, new):
        each.admit(2, stream(9, "weights"))
    for number in range(5, 9):
        np.testing.assert_array_equal(stack.values(2), new.values(2))
        np.testing.assert_array_equal(all_values(stack, [0, 1, 3]), all_values(undisturbed, [0, 1, 3]))
        for each in (stack, undisturbed, new):
            each.update(range(4), *replayed(number))


def test_who_is_not_named_learns_nothing() -> None:
    stack = a_full_stack()
    stack.update(range(4), *replayed(0))
    before = all_values(stack)
    stack.update([1, 3], *replayed(1))
    after = all_values(stack)
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    assert not np.array_equal(after[1], before[1])
    assert not np.array_equal(after[3], before[3])


def test_an_agent_computes_the_same_bits_in_every_slot() -> None:
    columns = []
    for slot in range(4):
        stack = a_full_stack()
        stack.admit(slot, stream(9, "weights"))
        for number in range(10):
            pairs, rewards = replayed(number)
            own_pairs, own_rewards = replayed(100 + number)
            pairs[slot], rewards[slot] = own_pairs[0], own_rewards[0]
            stack.update(range(4), pairs, rewards)
        columns.append(stack.values(slot).numpy())
    for column in columns[1:]:
        np.testing.assert_array_equal(column, columns[0])


@pytest.mark.parametrize("num_slots", [1, 7])
def test_a_stack_of_another_width_learns_the_same_but_for_rounding(num_slots: int) -> None:
    settings = replace(SETTINGS, num_slots=num_slots)
    stack, other = a_full_stack(), a_full_stack(settings)
    for number in range(10):
        stack.update(range(4), *replayed(number))
        other.update(range(num_slots), *replayed(number, settings))
    common = range(min(4, num_slots))
    np.testing.assert_allclose(all_values(other, common), all_values(stack, common), rtol=1e-4, atol=1e-5)


def test_the_best_action_is_taken_and_the_lowest_of_several() -> None:
    stack = a_full_stack()
    for state in range(NUM_STATES):
        best = [int(stack.values(slot)[state].argmax()) for slot in range(4)]
        assert stack.greedy(np.full(4, state)).tolist() == best == [stack.policy(slot)[state] for slot in range(4)]
    # A slot without an agent values all actions alike, until the first of them is punished.
    empty = a_stack()
    assert empty.greedy(STATES[:4]).tolist() == [0] * 4
    assert empty.policy(2).tolist() == [0] * NUM_STATES
    pairs = np.zeros((4, 6), dtype=np.int32)
    empty.update([2], pairs, np.full((4, 6), -1, dtype=np.float32))
    assert empty.greedy(STATES[:4]).tolist() == [0, 0, 1, 0]
    assert empty.policy(2).tolist() == [1] * NUM_STATES
