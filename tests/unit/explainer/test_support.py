import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.mdps import mdps
from tests.stochastic_mdps import as_mdp, fraction_worlds
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.stochastic import World, from_deterministic
from webapp.explainer.support import once, outcomes, support_graph, support_note

WORLDS = st.one_of(mdps(max_states=6), fraction_worlds().map(as_mdp))


def may_follow(world: World, state: int) -> list[int]:
    """Read off what each action of a state may lead to, action by action."""
    if isinstance(world, DeterministicMDP):
        return [int(after) for after in world.next_state[state]]
    rows = range(state * world.num_actions, (state + 1) * world.num_actions)
    return [int(after) for row in rows for after in world.next_state[world.row_start[row] : world.row_start[row + 1]]]


@given(WORLDS)
def test_every_outcome_of_every_action_is_listed(world: World) -> None:
    origins, heads = outcomes(world)
    listed = sorted(zip(origins.tolist(), heads.tolist(), strict=True))
    assert listed == sorted((s, after) for s in range(world.num_states) for after in may_follow(world, s))


@given(WORLDS)
def test_an_edge_leads_to_each_other_state_that_may_follow_and_counts_once(world: World) -> None:
    graph = support_graph(world)
    assert graph.num_states == world.num_states
    for state in range(world.num_states):
        assert graph.successors(state) == sorted(set(may_follow(world, state)) - {state})


@given(WORLDS, st.data())
def test_edges_stay_within_their_search(world: World, data: st.DataObject) -> None:
    graph, size = support_graph(world), world.num_states
    places = data.draw(st.lists(st.integers(0, 3 * size - 1)))
    tails, heads = graph.edges_from(np.array(places, dtype=np.int64))
    expected = [(place, place - place % size + after) for place in places for after in graph.successors(place % size)]
    assert list(zip(tails.tolist(), heads.tolist(), strict=True)) == expected


@given(st.lists(st.integers(0, 9)))
def test_places_named_more_than_once_are_left_once(places: list[int]) -> None:
    left = once(np.array(places, dtype=np.int64), np.zeros(10, dtype=np.int64)).tolist()
    assert sorted(left) == sorted(set(places))


@given(mdps())
def test_only_where_actions_have_chances_the_graph_needs_a_word(mdp: DeterministicMDP) -> None:
    assert support_note(mdp) == ""
    assert support_note(from_deterministic(mdp)) == "of all that may happen, however unlikely"
