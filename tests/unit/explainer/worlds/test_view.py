import pytest
from hypothesis import given, settings
from minigrid.core.constants import IDX_TO_OBJECT
from minigrid.minigrid_env import MiniGridEnv

from tests.worlds import LAYOUTS, lay_out, layouts, reachable_states
from webapp.explainer.worlds.environment import KeyDoorEnv
from webapp.explainer.worlds.key_door import KeyDoorState
from webapp.explainer.worlds.layout import HEADINGS, Layout, parse_layout
from webapp.explainer.worlds.view import Tile, View, egocentric_view, key_in_view

SYMBOLS = {
    Tile.UNSEEN: "?",
    Tile.WALL: "#",
    Tile.FLOOR: ".",
    Tile.KEY: "K",
    Tile.CLOSED_DOOR: "D",
    Tile.OPEN_DOOR: "/",
    Tile.GOAL: "G",
}
TILES = {symbol: tile for tile, symbol in SYMBOLS.items()}

ROOM = lay_out(
    "#######",
    "#>..#.#",
    "#..K#.#",
    "#...D.#",
    "#...#G#",
    "#######",
)


def drawn(view: View) -> list[str]:
    return ["".join(SYMBOLS[tile] for tile in row) for row in view.cells]


def view_of(*rows: str) -> View:
    return View(tuple(tuple(TILES[symbol] for symbol in row) for row in rows), has_key=False)


def minigrid_view(env: KeyDoorEnv, state: KeyDoorState) -> list[str]:
    """Draw MiniGrid's own observation of a state; it shows the agent's cell as empty or as the key in hand."""
    env.reset(options={"state": state})
    image = MiniGridEnv.gen_obs(env)["image"]  # type: ignore[no-untyped-call]
    doors = "/!D"  # Open, shut but unlocked, locked.
    symbols = {"unseen": "?", "empty": ".", "wall": "#", "key": "K", "goal": "G"}
    return ["".join(symbols.get(IDX_TO_OBJECT[kind]) or doors[lock] for kind, _, lock in image[:, y]) for y in range(3)]


def assert_views_agree_with_minigrid(layout: Layout) -> None:
    env = KeyDoorEnv(layout)
    for state in reachable_states(layout):
        if (state.x, state.y) == layout.goal:
            continue
        view = egocentric_view(layout, state)
        ours, theirs = drawn(view), minigrid_view(env, state)
        assert ours[:2] == theirs[:2], state
        assert (ours[2][0], ours[2][2]) == (theirs[2][0], theirs[2][2]), state
        assert ours[2][1] == ("/" if (state.x, state.y) == layout.door else "."), state
        assert view.has_key == bool(state.has_key)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_views_are_minigrids(layout: Layout) -> None:
    assert_views_agree_with_minigrid(layout)


@settings(max_examples=40)
@given(layouts())
def test_views_of_any_world_are_minigrids(layout: Layout) -> None:
    assert_views_agree_with_minigrid(layout)


@pytest.mark.parametrize(
    ("state", "picture"),
    [
        ((1, 1, 0, 0, 0), ["#.K", "#..", "#.."]),
        ((1, 1, 1, 0, 0), ["..#", "..#", "..#"]),
        ((1, 1, 2, 0, 0), ["???", "###", "..#"]),
        ((3, 3, 0, 0, 0), ["???", "#D#", "K.."]),  # A shut door hides what lies behind it.
        ((3, 3, 0, 1, 0), ["???", "#D#", "..."]),
        ((3, 3, 0, 1, 1), ["..G", "#/#", "..."]),  # Through an open door, what lies behind it is seen.
        ((4, 3, 0, 1, 1), ["###", "..G", "#/#"]),  # The doorway is drawn under the agent.
        ((4, 3, 2, 1, 1), ["...", "...", "#/#"]),
        ((5, 3, 0, 1, 1), ["???", "###", "..G"]),
        ((5, 2, 2, 0, 1), [".K.", "/##", "..."]),  # Askew through the doorway.
        ((5, 4, 1, 1, 1), ["???", "###", "#G#"]),  # The goal is drawn under the agent.
    ],
)
def test_a_view_is_what_lies_ahead_with_the_agent_facing_up(state: tuple[int, ...], picture: list[str]) -> None:
    assert drawn(egocentric_view(ROOM, KeyDoorState(*state))) == picture


def turned(layout: Layout) -> Layout:
    """Turn a world clockwise by a quarter."""
    rows = str(layout).splitlines()
    text = "\n".join("".join(row[x] for row in reversed(rows)) for x in range(layout.width))
    return parse_layout(text.translate({ord(HEADINGS[i]): HEADINGS[(i + 1) % 4] for i in range(4)}))


@settings(max_examples=30)
@given(layouts())
def test_a_view_does_not_depend_on_which_way_the_world_is_turned(layout: Layout) -> None:
    for state in reachable_states(layout):
        after = state._replace(x=layout.height - 1 - state.y, y=state.x, heading=(state.heading + 1) % 4)
        assert egocentric_view(turned(layout), after) == egocentric_view(layout, state)


@pytest.mark.parametrize(
    ("state", "in_view"),
    [
        ((1, 2, 0, 0, 0), True),
        ((1, 2, 0, 1, 0), False),  # In the hand, it is not in view.
        ((1, 2, 2, 0, 0), False),  # Behind the agent.
        ((5, 2, 2, 0, 0), False),  # Behind wall and door.
        ((4, 3, 2, 0, 1), True),  # Somebody who believes the door open sees it from the doorway.
    ],
)
def test_the_key_is_in_view_while_it_can_be_seen_lying(state: tuple[int, ...], in_view: bool) -> None:
    assert key_in_view(ROOM, KeyDoorState(*state)) is in_view


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        (("...", "..."), r"not \[3, 3\]"),
        (("...", "....", "..."), r"not \[3, 4, 3\]"),
        (("...", "...", ".#."), "stand on wall"),
        (("...", "...", ".D."), "stand on closed_door"),
        (("...", "...", ".K."), "stand on key"),
        (("...", "...", ".?."), "stand on unseen"),
        (("?..", "...", "..."), "row 0, column 0 of the view is in sight"),
        (("..#", "###", "..."), "row 0, column 0 of the view is hidden"),
    ],
)
def test_a_view_that_no_agent_can_have_is_refused(rows: tuple[str, ...], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        view_of(*rows)
