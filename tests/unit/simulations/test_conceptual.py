from fractions import Fraction
from itertools import product
from typing import get_args
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest

from tests.mdps import Oracle, State
from webapp.explainer.importance import PROBABILITY_KINDS, ProbabilityKind
from webapp.explainer.solvers import follow
from webapp.simulations.conceptual import (
    NODES,
    ConceptKind,
    Way,
    conceptual_rows,
    conceptual_world,
    draw_conceptual,
    policy_through,
)

NEIGHBOURS: dict[ConceptKind, dict[str, str]] = {
    "apart": {"S": "AB", "A": "SC", "B": "SC", "C": "ABG", "G": ""},
    "joined": {"S": "AB", "A": "SBC", "B": "SAC", "C": "ABG", "G": ""},
}
"""The diagram once more: from which node one may go to which."""

KINDS, WAYS = get_args(ConceptKind), get_args(Way)
ROWS = conceptual_rows()


def oracle(kind: ConceptKind, way: Way) -> Oracle:
    """Return the enumeration of all sequences of random actions on the diagram, nodes being letters."""

    def step(node: State, action: int) -> tuple[State, bool]:
        after = NODES[action] if NODES[action] in NEIGHBOURS[kind][str(node)] else node
        return after, after == "G"

    goes_to = {"S": way, "A": "C", "B": "C", "C": "G"}
    policy: dict[State, int] = {node: NODES.index(after) for node, after in goes_to.items()}
    return Oracle(step, len(NODES), policy, {"G"}, {"G"})


def importance(kind: ConceptKind, definition: str, r: int, way: Way) -> dict[str, float]:
    wanted = {"world": kind, "importance": definition, "random_steps": r, "way": way}
    chosen = ROWS[(ROWS[list(wanted)] == pd.Series(wanted)).all(axis=1)]
    return dict(zip(chosen["node"], chosen["value"], strict=True))


@pytest.mark.parametrize("kind", KINDS)
def test_an_action_leads_where_its_name_says_or_nowhere(kind: ConceptKind) -> None:
    world = conceptual_world(kind)
    for (here, node), (action, name) in product(enumerate(NODES), enumerate(world.actions)):
        target = name.removeprefix("to ")
        after = target if target in NEIGHBOURS[kind][node] else node
        assert world.states[world.next_state[here, action]] == after


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", WAYS)
def test_the_policy_passes_the_chosen_node_and_c_on_a_shortest_path(kind: ConceptKind, way: Way) -> None:
    world = conceptual_world(kind)
    path = follow(world, policy_through(world, way))
    assert [world.states[state] for state in path.states] == ["S", way, "C", "G"]


@pytest.mark.parametrize("definition", PROBABILITY_KINDS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", WAYS)
def test_every_value_is_that_of_enumerating_all_random_actions(
    kind: ConceptKind, definition: ProbabilityKind, way: Way
) -> None:
    slow = oracle(kind, way)
    for r in range(6):
        values = importance(kind, definition, r, way)
        for node in ("S", way, "C"):
            expected: Fraction = getattr(slow, definition)(node, r)
            assert values[node] == pytest.approx(float(expected), abs=1e-12)
        assert values["G"] == 0


@pytest.mark.parametrize("definition", PROBABILITY_KINDS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", WAYS)
def test_c_is_the_most_important_node_for_every_r_but_the_named_exceptions(
    kind: ConceptKind, definition: str, way: Way
) -> None:
    ties = {0, 1} if (kind, definition) == ("apart", "ace") else {0}
    for r in range(11):
        values = importance(kind, definition, r, way)
        if r in ties:
            assert values["C"] == pytest.approx(values[way])
        else:
            assert values["C"] > values[way] + 0.2


@pytest.mark.parametrize("definition", PROBABILITY_KINDS)
@pytest.mark.parametrize("way", WAYS)
def test_a_and_b_are_second_where_they_are_joined_and_elsewhere_for_odd_r(definition: str, way: Way) -> None:
    for r in range(1, 11):
        joined, apart = (importance(kind, definition, r, way) for kind in ("joined", "apart"))
        assert joined[way] > joined["S"] + 0.1
        if r % 2:
            assert apart[way] > apart["S"] + 0.1
        else:
            assert apart[way] == pytest.approx(apart["S"])


def test_b_is_on_its_way_what_a_is_on_its_own() -> None:
    through = {way: ROWS[ROWS["way"] == way]["value"].to_numpy() for way in WAYS}
    np.testing.assert_allclose(through["A"], through["B"], rtol=0, atol=1e-12)


def test_the_rows_name_every_world_importance_r_way_and_node_once() -> None:
    keys = ["world", "importance", "random_steps", "way", "node"]
    assert len(ROWS) == 2 * 2 * 11 * 2 * 4
    assert not ROWS.duplicated(keys).any()


def test_the_figure_names_the_nodes_and_both_importances_and_is_the_same_each_time() -> None:
    files = draw_conceptual(ROWS)
    assert files == draw_conceptual(pd.DataFrame(ROWS))
    assert set(files) == {"conceptual.svg", "conceptual.png"}
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314 - our own file.
    words = [str(node.text).strip() for node in ET.fromstring(files["conceptual.svg"], parser).iter()]  # noqa: S314
    assert {*NODES, "return probability", "average causal effect", "r, random actions"} <= set(words)
