import numpy as np
import torch

from tests.worlds import LAYOUTS, lay_out, reachable_states
from webapp.explainer.learning.encoding import NUM_ACTIONS, Encoding


def test_every_state_has_its_own_code_and_the_code_tells_the_state() -> None:
    encoding = Encoding(7, 4)
    np.testing.assert_array_equal(encoding.code(encoding.states), np.arange(7 * 4 * 4 * 2 * 2))
    assert len({tuple(state) for state in encoding.states.tolist()}) == encoding.num_codes


def test_an_observation_has_one_1_for_each_component_in_its_place() -> None:
    encoding = Encoding(3, 2)
    observed = encoding.observe(torch.tensor([[2, 0, 3, 0, 1]]))[0].tolist()
    assert observed == [*[0, 0, 1], *[1, 0], *[0, 0, 0, 1], *[1, 0], *[0, 1]]


def test_a_pair_is_the_observation_followed_by_the_action() -> None:
    encoding = Encoding(3, 2)
    code, action = 17, 3
    row = encoding.one_hot_pairs[code * NUM_ACTIONS + action]
    torch.testing.assert_close(row[:-NUM_ACTIONS], encoding.one_hot[code])
    assert row[-NUM_ACTIONS:].tolist() == [0, 0, 0, 1, 0]


def test_the_groups_divide_the_outputs_among_the_components_and_the_end() -> None:
    encoding = Encoding(6, 9)
    assert [len(range(*group.indices(encoding.num_outputs))) for group in encoding.groups] == [6, 9, 4, 2, 2, 2]
    assert [place for group in encoding.groups for place in range(group.start, group.stop)] == list(range(25))


def test_a_state_is_observed_alike_in_its_own_encoding_and_in_a_larger_one() -> None:
    small = lay_out("######", "#>KD.#", "#..#G#", "######")
    states = torch.tensor(reachable_states(small))
    own, larger = Encoding.of(small), Encoding.of(small, LAYOUTS["simulation"])
    assert (larger.width, larger.height) == (8, 8)
    inputs = own.columns_in(larger)[: own.num_inputs]
    assert len(set(own.columns_in(larger).tolist())) == own.num_outputs
    torch.testing.assert_close(larger.observe(states)[:, inputs], own.observe(states))
    assert larger.observe(states).sum() == own.observe(states).sum()
