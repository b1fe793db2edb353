"""Whole training runs, on maps so small that they take seconds, and what comes out of them."""

from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from tests.worlds import lay_out, reachable_states
from webapp.explainer.learning import Progress, TrainedAgent, TrainingFailed, TrainingSettings, judge, load, save, train
from webapp.explainer.learning.encoding import NUM_ACTIONS
from webapp.explainer.worlds.key_door import KeyDoorState, start_state, step, tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError

LAYOUTS = (lay_out("#######", "#>KD.G#", "#######"), lay_out("#####", "#.<##", "#KD.#", "###G#", "#####"))
SETTINGS = TrainingSettings(
    num_environments=8,
    num_exploring_environments=4,
    num_warmup_steps=150,
    policy_batch=128,
    num_single_queries=96,
    model_learning_rate=8e-3,
    cycle_iterations=700,
    window_iterations=60,
    checkpoint_iterations=20,
)
HOPELESS = replace(SETTINGS, cycle_iterations=5, num_cycles=1)


@pytest.fixture(scope="module")
def watched() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def agents(watched: list[Progress]) -> tuple[TrainedAgent, ...]:
    return train(LAYOUTS, SETTINGS, [3, 4], watched.append)


def live_pairs(layout: Layout) -> list[tuple[KeyDoorState, int]]:
    live = [state for state in reachable_states(layout) if (state.x, state.y) != layout.goal]
    return [(state, action) for state in live for action in range(NUM_ACTIONS)]


def shortest(layout: Layout) -> int:
    distance = {start_state(layout): 0}
    queue = deque(distance)
    while queue:
        state = queue.popleft()
        for action in range(NUM_ACTIONS):
            after, ends = step(layout, state, action)
            if ends:
                return distance[state] + 1
            if after not in distance:
                distance[after] = distance[state] + 1
                queue.append(after)
    raise AssertionError("the goal cannot be reached")


def greedy(agent: TrainedAgent, state: KeyDoorState) -> int:
    return int(agent.action_values(np.array([state]))[0].argmax())


def test_the_policy_is_optimal_from_the_start_and_arrives_from_everywhere(agents: tuple[TrainedAgent, ...]) -> None:
    for agent in agents:
        for first in {state for state, _ in live_pairs(agent.layout)}:
            state, num_steps, arrived = first, 0, False
            while not arrived:
                state, arrived = step(agent.layout, state, greedy(agent, state))
                num_steps += 1
                assert num_steps < 200, f"the policy loops from {first}"
            if first == start_state(agent.layout):
                assert num_steps == shortest(agent.layout)


def test_the_world_model_is_right_about_every_state_and_action(agents: tuple[TrainedAgent, ...]) -> None:
    for agent in agents:
        pairs = live_pairs(agent.layout)
        states, actions = np.array([state for state, _ in pairs]), np.array([action for _, action in pairs])
        after, ended = agent.predict(states, actions)
        expected = [step(agent.layout, *pair) for pair in pairs]
        assert [KeyDoorState(*state) for state in after.tolist()] == [state for state, _ in expected]
        assert ended.tolist() == [end for _, end in expected]


def test_tabulated_the_world_model_is_the_worlds_table(agents: tuple[TrainedAgent, ...]) -> None:
    for agent in agents:
        learned, exact = agent.tabulate(), tabulate(agent.layout)
        assert learned.states == exact.states
        np.testing.assert_array_equal(learned.next_state, exact.next_state)
        np.testing.assert_array_equal(learned.terminal, exact.terminal)


def test_the_recurrent_model_carries_its_hidden_state_along(agents: tuple[TrainedAgent, ...]) -> None:
    agent = agents[0]
    model = agent.recurrent_model()
    state = torch.tensor([start_state(agent.layout)])
    hidden = model.initial(1)
    seen = []
    for action in (3, 4, 1, 2, 0):
        hidden, state, ended = model.step(hidden, state, torch.tensor([action]))
        seen.append((tuple(state[0].tolist()), bool(ended)))
    truth, expected = start_state(agent.layout), []
    for action in (3, 4, 1, 2, 0):
        truth, ends = step(agent.layout, truth, action)
        expected.append((tuple(truth), ends))
    assert seen == expected
    inputs = torch.tensor([start_state(agent.layout)]), torch.tensor([0])
    fresh, carried = model.logits(model.initial(1), *inputs), model.logits(hidden, *inputs)
    assert not torch.equal(fresh[1], carried[1])


def test_agents_say_how_they_were_trained(agents: tuple[TrainedAgent, ...]) -> None:
    for agent, seed in zip(agents, (3, 4), strict=True):
        assert agent.facts["seed"] == seed
        assert agent.num_steps == SETTINGS.num_environments * (SETTINGS.num_warmup_steps + agent.num_iterations)
        assert 0 < agent.num_visited_starts <= agent.num_episodes / 2
        assert agent.num_iterations % SETTINGS.checkpoint_iterations == 0
        assert 0 < agent.policy_loss < 0.01
        assert 0 < agent.model_loss < 0.1
    policy = (5 + 5 + 8 + 1) * 64 + (64 + 1) * 64 + (64 + 1) * 5
    model = (5 + 5 + 8 + 5 + 1) * 96 + 96 * 96 + (96 + 1) * (5 + 5 + 8 + 2)
    assert agents[1].num_parameters == policy + model


def test_progress_never_falls_and_ends_at_1_when_everybody_has_passed(
    agents: tuple[TrainedAgent, ...], watched: list[Progress]
) -> None:
    fractions = [progress.fraction for progress in watched]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert fractions[0] < 0.1
    assert watched[-1].num_passed == watched[-1].num_agents == len(agents)
    assert watched[-1].iteration == max(agent.num_iterations for agent in agents) <= SETTINGS.max_iterations
    last_before = max(agent.num_iterations for agent in agents) - SETTINGS.checkpoint_iterations
    assert all(progress.num_passed < 2 for progress in watched if progress.iteration <= last_before)


def test_the_same_seeds_give_the_same_bytes_and_others_do_not(agents: tuple[TrainedAgent, ...], tmp_path: Path) -> None:
    torch.manual_seed(1)
    again = train(LAYOUTS, SETTINGS, [3, 4])
    other = train(LAYOUTS, SETTINGS, [3, 5])
    for name, trained in (("first", agents), ("again", again), ("other", other)):
        save(trained, tmp_path / name)
    first = (tmp_path / "first").read_bytes()
    assert (tmp_path / "again").read_bytes() == first
    assert (tmp_path / "other").read_bytes() != first


def test_training_leaves_the_global_randomness_and_the_number_of_threads_alone() -> None:
    state, threads = torch.get_rng_state(), torch.get_num_threads()
    with pytest.raises(TrainingFailed):
        train(LAYOUTS[:1], HOPELESS, [0])
    assert torch.equal(torch.get_rng_state(), state)
    assert torch.get_num_threads() == threads


def test_a_budget_that_is_too_small_is_an_error_that_says_what_each_agent_was_missing() -> None:
    with pytest.raises(TrainingFailed) as failure:
        train(LAYOUTS, HOPELESS, [0, 0])
    message = str(failure.value)
    assert message.startswith("after 5 iterations, agent 1 of 2: ")
    for layout, part in zip(LAYOUTS, message.split(" | "), strict=True):
        pairs = live_pairs(layout)
        assert f" of {len(pairs)} state-action pairs" in part
        assert f" of {len(pairs) // NUM_ACTIONS} states" in part
        assert "its losses have not flattened" in part


def test_a_map_whose_goal_is_out_of_reach_is_refused() -> None:
    with pytest.raises(LayoutError, match="cannot be reached"):
        train([lay_out("########", "#>KD.#G#", "########")], HOPELESS, [0])


@pytest.mark.parametrize(("layouts", "seeds"), [((), ()), (LAYOUTS, (1,))])
def test_training_needs_a_seed_for_each_map(layouts: tuple[Layout, ...], seeds: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="maps and as many seeds"):
        train(layouts, SETTINGS, seeds)


def test_saved_agents_are_read_back_as_they_were(agents: tuple[TrainedAgent, ...], tmp_path: Path) -> None:
    file = tmp_path / "weights.safetensors"
    save(agents, file)
    for agent, found in zip(agents, load(file, LAYOUTS), strict=True):
        assert found.layout == agent.layout
        assert found.facts == agent.facts
        for stored, own in (
            (found.policy_weights, agent.policy_weights),
            (found.model_weights, agent.model_weights),
        ):
            assert stored.keys() == own.keys()
            assert all(torch.equal(stored[name], own[name]) for name in own)
    save(load(file, LAYOUTS), tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == file.read_bytes()


def test_agents_of_other_maps_and_other_files_are_refused(agents: tuple[TrainedAgent, ...], tmp_path: Path) -> None:
    file = tmp_path / "weights.safetensors"
    save(agents, file)
    with pytest.raises(ValueError, match="other maps"):
        load(file, LAYOUTS[::-1])
    file.write_bytes(b"something else")
    with pytest.raises(ValueError, match="holds no agents"):
        load(file, LAYOUTS)


def test_the_verdict_counts_what_is_wrong(agents: tuple[TrainedAgent, ...]) -> None:
    agent = agents[0]
    table = tabulate(agent.layout)
    pairs = live_pairs(agent.layout)
    assert judge(agent, table).is_right
    assert judge(agent, table).missing == ()
    # An agent that prefers to turn left wherever it is never arrives.
    weights = dict(agent.policy_weights)
    weights["values.bias"] = weights["values.bias"] + torch.tensor([0.0, 100.0, 0.0, 0.0, 0.0])
    verdict = judge(replace(agent, policy_weights=weights), table)
    assert (verdict.is_optimal, verdict.num_lost) == (False, len(pairs) // NUM_ACTIONS)
    assert not verdict.is_right
    assert len(verdict.missing) == 2
    # A world model that expects every episode to go on is wrong wherever one ends, and nowhere else.
    weights = dict(agent.model_weights)
    goes_on = torch.zeros_like(weights["readout.bias"])
    goes_on[0, -2] = 1000.0
    weights["readout.bias"] = weights["readout.bias"] + goes_on
    verdict = judge(replace(agent, model_weights=weights), table)
    num_ends = sum(step(agent.layout, *pair)[1] for pair in pairs)
    assert (verdict.num_wrong, verdict.num_pairs) == (num_ends, len(pairs))
    assert verdict.missing == (f"the world model is wrong on {num_ends} of {len(pairs)} state-action pairs",)
    assert not verdict.is_right
