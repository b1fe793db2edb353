"""Coarse worlds against plain dictionaries: what they promise can be done, and what cannot be done is refused."""

from collections.abc import Hashable, Iterator, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import ROOT
from tests.mdps import mdps
from tests.stochastic_mdps import FractionWorld, as_mdp, fraction_worlds
from webapp.explainer.abstraction import (
    Abstraction,
    CoarseWorld,
    Part,
    UnsoundAbstraction,
    by_components,
    coarsen,
    sound_refinement,
)
from webapp.explainer.mdp import DeterministicMDP, enumerate_mdp
from webapp.explainer.solvers import distances_to_goal, follow, plan
from webapp.explainer.stochastic import World, from_outcomes
from webapp.explainer.worlds.key_door import KeyDoorState, tabulate
from webapp.explainer.worlds.key_door_abstractions import places_of
from webapp.explainer.worlds.layout import parse_layout

FOUR_ROOMS = parse_layout((ROOT / "docs" / "maps" / "four-rooms.txt").read_text(encoding="utf-8"))
GUIDE = (ROOT / "docs" / "hierarchy.md").read_text(encoding="utf-8")


def named(partition: Mapping[Hashable, int]) -> Abstraction:
    """Return the abstraction that maps labels as listed; the edges are named after where they lead."""
    return Abstraction("the partition", lambda label: partition[label], lambda _, after: f"to {after}")


@st.composite
def partitioned(draw: st.DrawFn) -> tuple[DeterministicMDP, dict[Hashable, int]]:
    """Draw a world and a number for each of its states, the goal and the other end apart."""
    mdp = draw(mdps(max_states=7))
    numbers = draw(st.lists(st.integers(0, 2), min_size=mdp.num_states, max_size=mdp.num_states))
    ends = {int(state): 3 + int(mdp.goal[state]) for state in np.flatnonzero(mdp.terminal)}
    return mdp, {label: ends.get(state, numbers[state]) for state, label in enumerate(mdp.states)}


def outcomes_of(world: World) -> dict[tuple[int, int], set[int]]:
    """Return what may follow each state and action; nothing follows an end."""
    alive = [state for state in range(world.num_states) if not world.terminal[state]]
    if isinstance(world, DeterministicMDP):
        return {(s, a): {int(world.next_state[s, a])} for s in alive for a in range(world.num_actions)}
    rows = {(s, a): s * world.num_actions + a for s in alive for a in range(world.num_actions)}
    return {
        pair: set(world.next_state[world.row_start[row] : world.row_start[row + 1]].tolist())
        for pair, row in rows.items()
    }


def reached(outcomes: Mapping[tuple[int, int], set[int]], start: int) -> set[int]:
    known = {start}
    while new := {t for (s, _), after in outcomes.items() if s in known for t in after} - known:
        known |= new
    return known


def policies(members: list[int], num_actions: int) -> Iterator[dict[int, int]]:
    for choice in product(range(num_actions), repeat=len(members)):
        yield dict(zip(members, choice, strict=True))


def surely(
    outcomes: Mapping[tuple[int, int], set[int]], num_actions: int, block: set[int], wanted: set[int]
) -> set[int]:
    """Return the members of a block that some policy leads to a set with probability 1 and nowhere else before.

    Every policy is tried: it is sure where nothing that may happen under it leaves the block for somewhere else or
    comes to a state from which it can no longer arrive.
    """
    found: set[int] = set()
    for policy in policies(sorted(block), num_actions):
        moves = {state: outcomes[state, action] for state, action in policy.items()}
        able = {state for state in block if moves[state] & wanted}
        while new := {state for state in block if moves[state] & able} - able:
            able |= new
        sure = set(able)
        while bad := {state for state in sure if moves[state] - wanted - sure}:
            sure -= bad
        found |= {state for state in sure if _arrives(state, moves, wanted, sure)}
    return found


def _arrives(state: int, moves: Mapping[int, set[int]], wanted: set[int], sure: set[int]) -> bool:
    """Say whether the set can be reached from everything that may follow."""
    ahead = {state}
    while new := {t for s in ahead for t in moves[s] if t in sure} - ahead:
        ahead |= new
    able = {s for s in ahead if moves[s] & wanted}
    while more := {s for s in ahead if moves[s] & able} - able:
        able |= more
    return able == ahead


def is_sound(world: World, partition: Mapping[Hashable, int]) -> bool:
    outcomes = outcomes_of(world)
    blocks: dict[int, set[int]] = {}
    for state in reached(outcomes, world.start):
        blocks.setdefault(partition[world.states[state]], set()).add(state)
    for block in blocks.values():
        if len({(bool(world.terminal[state]), bool(world.goal[state])) for state in block}) > 1:
            return False
        if any(world.terminal[state] for state in block):
            continue
        for wanted in blocks.values():
            can = surely(outcomes, world.num_actions, block, wanted) if wanted is not block else set()
            if can and can != block:
                return False
    return True


def refusal(world: World, partition: Mapping[Hashable, int]) -> str:
    """Return why a partition is refused, or nothing."""
    try:
        coarsen(world, named(partition))
    except ValueError as error:
        return str(error)
    return ""


@given(partitioned())
def test_a_partition_is_accepted_exactly_if_everybody_in_a_block_can_do_what_some_can(
    drawn: tuple[DeterministicMDP, dict[Hashable, int]],
) -> None:
    mdp, partition = drawn
    message = refusal(mdp, partition)
    assert is_sound(mdp, partition) == ("is not sound" not in message)
    assert not message or "is not sound" in message or "nothing ever happens" in message


@given(fraction_worlds(max_states=5, max_actions=2), st.lists(st.integers(0, 2), min_size=5, max_size=5))
def test_where_chances_decide_only_what_is_sure_counts(world: FractionWorld, numbers: list[int]) -> None:
    mdp = as_mdp(world)
    ends = {int(state): 3 + int(mdp.goal[state]) for state in np.flatnonzero(mdp.terminal)}
    partition: dict[Hashable, int] = {s: ends.get(i, numbers[i]) for i, s in enumerate(mdp.states)}
    message = refusal(mdp, partition)
    assert is_sound(mdp, partition) == ("is not sound" not in message)
    if message:
        return
    coarse = coarsen(mdp, named(partition))
    outcomes = outcomes_of(mdp)
    for block, after in edges_of(coarse):
        members, wanted = members_of(coarse, block), members_of(coarse, after)
        assert surely(outcomes, mdp.num_actions, members, wanted) == members


def edges_of(coarse: CoarseWorld) -> set[tuple[int, int]]:
    pairs = {(block, int(after)) for block, row in enumerate(coarse.mdp.next_state) for after in row}
    return {(block, after) for block, after in pairs if block != after}


def members_of(coarse: CoarseWorld, block: int) -> set[int]:
    return set(np.flatnonzero((coarse.block_of == block) & coarse.reachable).tolist())


@given(partitioned())
def test_every_coarse_plan_can_be_carried_out_from_every_state(
    drawn: tuple[DeterministicMDP, dict[Hashable, int]],
) -> None:
    mdp, partition = drawn
    try:
        coarse = coarsen(mdp, sound_refinement(mdp, named(partition)))
    except ValueError:
        return
    steps, coarse_steps = distances_to_goal(mdp), distances_to_goal(coarse.mdp)
    policy = plan(coarse.mdp)
    for state in np.flatnonzero(coarse.reachable).tolist():
        block = int(coarse.block_of[state])
        assert np.isinf(steps[state]) == np.isinf(coarse_steps[block])
        assert coarse_steps[block] <= steps[state]
        if np.isfinite(coarse_steps[block]):
            here = state
            for wanted in follow(coarse.mdp, policy, block).states[1:]:
                here = _walk(mdp, coarse, here, wanted)
            assert mdp.goal[here]


def _walk(mdp: DeterministicMDP, coarse: CoarseWorld, state: int, wanted: int) -> int:
    """Walk about in the state's own block until a step leads into the wanted one."""
    block, seen, queue = coarse.block_of[state], {state}, [state]
    for here in queue:
        for after in mdp.next_state[here].tolist():
            if coarse.block_of[after] == wanted:
                return int(after)
            if coarse.block_of[after] == block and after not in seen:
                seen.add(after)
                queue.append(after)
    raise AssertionError(f"block {wanted} cannot be reached from state {state} within block {block}")


@given(partitioned())
def test_a_refinement_is_sound_tells_apart_what_it_must_and_nothing_more(
    drawn: tuple[DeterministicMDP, dict[Hashable, int]],
) -> None:
    mdp, partition = drawn
    refined = sound_refinement(mdp, named(partition))
    reachable = [mdp.states[state] for state in reached(outcomes_of(mdp), mdp.start)]
    parts = {label: refined.coarse(label) for label in reachable}
    assert all((part.whole if isinstance(part, Part) else part) == partition[label] for label, part in parts.items())
    numbers = {part: number for number, part in enumerate(dict.fromkeys(parts.values()))}
    assert is_sound(mdp, {label: numbers[part] for label, part in parts.items()})
    for one, other in product(numbers, repeat=2):
        wholes = [part.whole if isinstance(part, Part) else part for part in (one, other)]
        if one != other and wholes[0] == wholes[1]:
            merged = {label: numbers[other if part == one else part] for label, part in parts.items()}
            assert not is_sound(mdp, merged)


def place_alone() -> Abstraction:
    places = places_of(FOUR_ROOMS)

    def coarse(label: Hashable) -> Hashable:
        assert isinstance(label, KeyDoorState)
        return places[label.x, label.y]

    return Abstraction("places", coarse, lambda _, after: f"enter {after}")


def test_a_room_without_its_key_is_not_promised_to_lead_through_the_door() -> None:
    world = tabulate(FOUR_ROOMS)
    with pytest.raises(UnsoundAbstraction) as refused:
        coarsen(world, place_alone())
    message = str(refused.value)
    assert "some states can surely 'enter the doorway'" in message
    assert "has_key=0" in message
    assert message in " ".join(GUIDE.split()), "the guide quotes the message"
    parts = {str(label) for label in coarsen(world, sound_refinement(world, place_alone())).mdp.states}
    assert {"room 2", "room 2 (part 2)"} <= parts


def test_the_example_in_the_guide_does_what_the_guide_says(capsys: pytest.CaptureFixture[str]) -> None:
    program = GUIDE.split("```python\n")[1].split("```")[0]
    exec(program, {"__name__": "guide"})  # noqa: S102 - it is our own.
    assert capsys.readouterr().out.splitlines() == [
        "10 states seen as 5",
        "(1, 1) at stove 0.0 ",
        "(2, 2) boiled True 0.5 subgoal",
        "(3, 3) at table 0.0 ",
        "(4, 4) served True 1.0 subgoal",
    ]


class Job(NamedTuple):
    place: str
    loaded: bool
    lamp: bool


def office() -> DeterministicMDP:
    """Return a world that is no grid: fetch a parcel from the store, bring it home; a lamp is of no consequence."""

    def step(job: Job, action: int) -> tuple[Job, bool]:
        if action == 0:
            after = job._replace(place={"store": "hall", "hall": "store", "home": "hall"}[job.place])
        elif action == 1:
            after = job._replace(place="home") if job.place == "hall" else job
        elif action == 2:
            after = job._replace(loaded=True) if job.place == "store" else job
        else:
            after = job._replace(lamp=not job.lamp)
        return after, after.place == "home" and after.loaded

    return enumerate_mdp(Job("hall", loaded=False, lamp=False), ("walk", "go home", "load", "switch"), step)


def test_components_that_do_not_matter_can_be_dropped_by_name_or_by_position() -> None:
    named_parts = coarsen(office(), by_components(["place", "loaded"]))
    by_position = coarsen(office(), by_components([0, 1]))
    assert named_parts.mdp.states == by_position.mdp.states
    assert len(named_parts.mdp.states) == len(office().states) / 2
    path = follow(named_parts.mdp, plan(named_parts.mdp))
    names = [named_parts.mdp.actions[action] for action in path.actions]
    assert names == ["place store", "loaded True", "place hall", "place home"]
    assert by_position.mdp.actions[0] == "0 store"


def test_components_that_matter_cannot_be_dropped() -> None:
    with pytest.raises(
        UnsoundAbstraction, match=r"mixes states that end the episode, such as Job\(place='home', loaded"
    ):
        coarsen(office(), by_components(["place"], "places"))


@pytest.mark.parametrize(
    ("components", "message"),
    [
        ([], "name at least one component"),
        (["place", "place"], "each one once"),
        (["colour"], r"no component 'colour'"),
        ([3], "no component 3"),
        ([-1], "no component -1"),
    ],
)
def test_components_that_are_not_there_are_refused(components: list[str | int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        coarsen(office(), by_components(components))


def tiny(next_state: list[list[int]], *, terminal: set[int], goal: set[int]) -> DeterministicMDP:
    num_states, num_actions = len(next_state), len(next_state[0])
    ended, arrived = (np.isin(np.arange(num_states), list(chosen)) for chosen in (terminal, goal))
    actions = tuple(f"a{i}" for i in range(num_actions))
    return DeterministicMDP(
        tuple(range(num_states)), actions, np.array(next_state, dtype=np.int32), ended, arrived, start=0
    )


def test_an_end_that_is_no_goal_is_kept_apart_from_the_goal() -> None:
    fork = tiny([[1, 2], [1, 1], [2, 2]], terminal={1, 2}, goal={2})
    with pytest.raises(UnsoundAbstraction, match="1 mixes goals, such as 2, with others, such as 1; keep apart"):
        coarsen(fork, named({0: 0, 1: 1, 2: 1}))


def test_a_world_that_looks_all_the_same_is_refused() -> None:
    with pytest.raises(ValueError, match="the partition sees every state as 7, so nothing ever happens"):
        coarsen(tiny([[1], [0]], terminal=set(), goal=set()), named({0: 7, 1: 7}))


def test_an_edge_without_a_name_is_refused() -> None:
    silent = Abstraction("silence", lambda label: label, lambda *_: "")
    with pytest.raises(ValueError, match="silence has no name for the way from 0 to 1"):
        coarsen(tiny([[1], [1]], terminal={1}, goal={1}), silent)


def test_ways_with_one_name_to_two_blocks_are_numbered() -> None:
    fork = tiny([[1, 2], [1, 1], [2, 2]], terminal={1, 2}, goal={2})
    coarse = coarsen(fork, Abstraction("labels", lambda label: label, lambda *_: "go"))
    assert coarse.mdp.actions == ("go", "go (2)")
    assert coarse.mdp.next_state.tolist() == [[1, 2], [1, 1], [2, 2]]


def test_states_out_of_reach_neither_count_nor_have_a_coarse_state() -> None:
    island = tiny([[1, 1], [1, 1], [2, 0]], terminal={1}, goal={1})
    coarse = coarsen(island, named({0: 0, 1: 1}))
    assert coarse.mdp.states == (0, 1)
    assert coarse.coarse_states([0, 1]) == (0, 1)
    with pytest.raises(ValueError, match="state 2 cannot be reached from the start, so it has no coarse state"):
        coarse.coarse_states([2])
    with pytest.raises(ValueError, match="there is no state 3; there are 3, from 0"):
        coarse.coarse_states([3])


def chance_world(outcomes: list[tuple[int, int, int, float]]) -> World:
    ends = np.array([False, False, True, True])
    return from_outcomes(range(4), ["try", "dare"], outcomes, terminal=ends, goal=np.arange(4) == 3, start=0)


def test_what_succeeds_in_the_end_with_certainty_is_a_coarse_action() -> None:
    patient = [(0, 0, 0, 0.9), (0, 0, 3, 0.1), (0, 1, 2, 0.5), (0, 1, 3, 0.5), (1, 0, 1, 1.0), (1, 1, 1, 1.0)]
    coarse = coarsen(chance_world(patient), named({0: 0, 2: 2, 3: 3}))
    assert coarse.mdp.actions == ("to 3",)


def test_a_world_in_which_nothing_is_sure_has_no_coarse_actions() -> None:
    gamble = [(0, a, after, 0.5) for a in (0, 1) for after in (2, 3)] + [(1, 0, 1, 1.0), (1, 1, 1, 1.0)]
    with pytest.raises(UnsoundAbstraction, match="has no actions: chance decides about every way out of a block"):
        coarsen(chance_world(gamble), named({0: 0, 2: 2, 3: 3}))
