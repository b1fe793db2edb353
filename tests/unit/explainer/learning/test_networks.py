import math

import pytest
import torch

from webapp.explainer.learning.encoding import NUM_ACTIONS, Encoding
from webapp.explainer.learning.networks import (
    StackedAdam,
    Weights,
    action_values,
    new_model_weights,
    new_policy_weights,
    padding_mask,
    select,
    stack,
    unroll,
    unstack,
)

OWN = [Encoding(4, 6), Encoding(7, 3), Encoding(7, 6)]
COMMON = Encoding(7, 6)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def policies() -> list[Weights]:
    return [new_policy_weights(encoding, 11, generator(i)) for i, encoding in enumerate(OWN)]


def models() -> list[Weights]:
    return [new_model_weights(encoding, 9, 0.5, generator(i)) for i, encoding in enumerate(OWN)]


@pytest.mark.parametrize("agents", [policies(), models()], ids=["policy", "model"])
def test_each_agent_comes_out_of_the_stack_as_it_went_in(agents: list[Weights]) -> None:
    stacked = stack(agents, OWN, COMMON)
    for agent, weights in enumerate(agents):
        found = unstack(stacked, agent, OWN[agent], COMMON)
        assert found.keys() == weights.keys()
        for name, tensor in weights.items():
            torch.testing.assert_close(found[name], tensor, rtol=0, atol=0)


def test_in_the_stack_each_agent_values_actions_as_it_would_alone() -> None:
    stacked = stack(policies(), OWN, COMMON)
    states = torch.tensor([[1, 2, 3, 0, 1], [3, 0, 0, 1, 0]])
    together = action_values(stacked, COMMON.observe(states).expand(3, -1, -1))
    for agent, (weights, encoding) in enumerate(zip(policies(), OWN, strict=True)):
        alone = {name: tensor[None] for name, tensor in weights.items()}
        torch.testing.assert_close(together[agent], action_values(alone, encoding.observe(states)[None])[0])
        hidden = torch.relu(encoding.observe(states) @ weights["first.weight"] + weights["first.bias"])
        hidden = torch.relu(hidden @ weights["second.weight"] + weights["second.bias"])
        torch.testing.assert_close(together[agent], hidden @ weights["values.weight"] + weights["values.bias"])


class TorchModel:
    """The same network, made of torch's own modules."""

    def __init__(self, weights: Weights) -> None:
        num_inputs, num_units = weights["input.weight"].shape
        self._rnn = torch.nn.RNN(num_inputs, num_units)
        self._weights = weights
        self._rnn.load_state_dict(
            {
                "weight_ih_l0": weights["input.weight"].T,
                "weight_hh_l0": weights["hidden.weight"].T,
                "bias_ih_l0": weights["hidden.bias"][0],
                "bias_hh_l0": torch.zeros(num_units),
            }
        )

    def run(self, inputs: torch.Tensor, hidden: torch.Tensor | None = None) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the logits `[L, outputs]` of one sequence `[L, inputs]`, and the hidden state `[units]` at its end."""
        states, last = self._rnn(inputs, None if hidden is None else hidden[None])
        return states @ self._weights["readout.weight"] + self._weights["readout.bias"], last[0]


def test_the_stacked_world_models_are_those_of_torch_and_forget_when_an_episode_begins() -> None:
    weights = models()[2]
    inputs = torch.randn(1, 5, 3, COMMON.num_inputs + NUM_ACTIONS, generator=generator())
    singles = torch.randn(1, 4, COMMON.num_inputs + NUM_ACTIONS, generator=generator(1))
    keep = torch.ones(1, 5, 3, 1)
    keep[0, 2, 1] = 0.0
    of_sequences, of_singles = unroll(stack([weights], [COMMON], COMMON), inputs, keep, singles, 3)
    model, logits = TorchModel(weights), of_sequences.view(5, 3, -1)
    last = []
    for sequence, begins in ((0, [0]), (1, [0, 2]), (2, [0])):
        for begin, end in zip(begins, [*begins[1:], 5], strict=True):
            expected, hidden = model.run(inputs[0, begin:end, sequence])
            torch.testing.assert_close(logits[begin:end, sequence], expected)
        last.append(hidden)
    torch.testing.assert_close(of_singles[0, :1], model.run(singles[0, :1])[0])
    # The last three single queries begin where the three sequences have ended.
    for query, hidden in enumerate(last, start=1):
        torch.testing.assert_close(
            of_singles[0, query : query + 1], model.run(singles[0, query : query + 1], hidden)[0]
        )


def test_the_mask_leaves_each_agent_the_outputs_of_its_own_map() -> None:
    mask = padding_mask(OWN, COMMON)
    for agent, encoding in enumerate(OWN):
        kept = mask[agent, 0] == 0
        sizes = [int(kept[group].sum()) for group in COMMON.groups]
        assert sizes == [encoding.width, encoding.height, 4, 2, 2, 2]
        assert torch.all(mask[agent, 0][~kept] == -math.inf)


def test_padding_is_never_trained() -> None:
    stacked = stack(models(), OWN, COMMON)
    adam = StackedAdam(stacked, 1.0)
    mask = padding_mask(OWN, COMMON)
    states = torch.tensor([[1, 2, 3, 0, 1], [3, 0, 0, 1, 0]])
    inputs = torch.cat((COMMON.observe(states), torch.eye(NUM_ACTIONS)[:2]), dim=1)
    for _ in range(3):
        singles = inputs.expand(3, 2, -1)
        sequences = singles[:, None].expand(3, 4, 2, -1)
        logits, _ = unroll(stacked, sequences, torch.ones(3, 4, 2, 1), singles, 0)
        torch.autograd.backward(-torch.log_softmax((logits + mask)[..., COMMON.groups[0]], dim=2)[..., 2].sum())
        adam.step(0.1)
    narrow = Encoding(4, 6)
    inside = torch.zeros(COMMON.num_outputs, dtype=torch.bool)
    inside[narrow.columns_in(COMMON)] = True
    assert not stacked["readout.weight"][0][:, ~inside].any()
    assert not stacked["input.weight"][0][: COMMON.num_inputs][~inside[: COMMON.num_inputs]].any()


def test_the_stacked_optimizer_is_adam_with_gradients_clipped_for_each_agent_by_itself() -> None:
    stacked = stack(policies(), OWN, COMMON)
    adam = StackedAdam(stacked, 0.5)
    observations = torch.randn(3, 8, COMMON.num_inputs, generator=generator())
    observations[:, :, 4:7] = 0.0
    observations[:, :, 10:13] = 0.0
    scale = torch.tensor([0.001, 1.0, 100.0])[:, None, None]
    alone = []
    for agent in range(3):
        own = {name: tensor.detach()[agent : agent + 1].clone().requires_grad_() for name, tensor in stacked.items()}
        alone.append((own, torch.optim.Adam(own.values(), lr=0.01)))
    for _ in range(4):
        torch.autograd.backward((action_values(stacked, observations) * scale).square().sum())
        adam.step(0.01)
        for agent, (own, optimizer) in enumerate(alone):
            optimizer.zero_grad()
            torch.autograd.backward((action_values(own, observations[agent : agent + 1]) * scale[agent]).square().sum())
            torch.nn.utils.clip_grad_norm_(own.values(), 0.5)
            optimizer.step()
    for agent, (own, _) in enumerate(alone):
        for name, tensor in own.items():
            torch.testing.assert_close(stacked[name][agent], tensor[0], rtol=1e-4, atol=1e-6)


def test_those_that_stay_in_the_stack_learn_on_as_if_nobody_had_left() -> None:
    observations = torch.randn(3, 8, COMMON.num_inputs, generator=generator())

    def learn(adam: StackedAdam, agents: list[int]) -> None:
        torch.autograd.backward(action_values(adam.weights, observations[agents]).square().sum())
        adam.step(0.01)

    everybody = StackedAdam(stack(policies(), OWN, COMMON), 1.0)
    for _ in range(3):
        learn(everybody, [0, 1, 2])
    some = everybody.select([2, 0])
    for _ in range(3):
        learn(everybody, [0, 1, 2])
        learn(some, [2, 0])
    for name, tensor in select(everybody.weights, [2, 0]).items():
        torch.testing.assert_close(some.weights[name], tensor, rtol=1e-5, atol=1e-7)


def test_a_step_without_gradients_is_refused() -> None:
    with pytest.raises(ValueError, match="no gradient"):
        StackedAdam(stack(policies(), OWN, COMMON), 1.0).step(0.1)
