from pathlib import Path

import pytest
from hypothesis import given

from tests.worlds import LAYOUT_FILES, map_texts
from webapp.explainer.worlds.layout import LayoutError, parse_layout

GOOD = """\
######
#>K#G#
#..D.#
######
"""


def test_a_map_is_read_in_minigrid_coordinates() -> None:
    layout = parse_layout(GOOD)
    assert (layout.width, layout.height) == (6, 4)
    assert (layout.start, layout.heading) == ((1, 1), 0)
    assert (layout.key, layout.door, layout.goal) == ((2, 1), (3, 2), (4, 1))
    assert (3, 1) in layout.walls
    assert (1, 2) not in layout.walls


@pytest.mark.parametrize(("symbol", "heading"), [(">", 0), ("v", 1), ("<", 2), ("^", 3)])
def test_each_agent_symbol_is_a_heading(symbol: str, heading: int) -> None:
    assert parse_layout(GOOD.replace(">", symbol)).heading == heading


@given(map_texts())
def test_a_map_of_any_size_is_read_and_drawn_back(text: str) -> None:
    assert str(parse_layout(text)) == text


@pytest.mark.parametrize("path", LAYOUT_FILES, ids=lambda path: path.stem)
def test_the_studys_maps_are_drawn_back_as_their_files_are(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert str(parse_layout(text)) == text


def test_blank_lines_after_the_map_are_ignored() -> None:
    assert parse_layout(GOOD + "\n  \n") == parse_layout(GOOD)


def test_windows_line_ends_are_read() -> None:
    assert parse_layout(GOOD.replace("\n", "\r\n")) == parse_layout(GOOD)


@pytest.mark.parametrize(
    ("text", "line", "column", "problem"),
    [
        ("", 1, 1, "the map is empty"),
        ("\n \n", 1, 1, "the map is empty"),
        (GOOD.replace("K", "."), 4, 6, "there is no key (K)"),
        (GOOD.replace("D", "."), 4, 6, "there is no door (D)"),
        (GOOD.replace("G", "."), 4, 6, "there is no goal (G)"),
        (GOOD.replace(">", "."), 4, 6, "there is no agent"),
        (GOOD.replace("#..D", "#K.D"), 3, 2, "there is a second key (K)"),
        (GOOD.replace("#..D", "#.DD"), 3, 4, "there is a second door (D)"),
        (GOOD.replace("D.#", "DG#"), 3, 5, "there is a second goal (G)"),
        (GOOD.replace("#..D", "#.^D"), 3, 3, "there is a second agent"),
        (GOOD.replace("#..D", "#>.D"), 3, 2, "there is a second agent"),
        (GOOD.replace("#..D.#", "#..D.##"), 3, 7, "the row has 7 cells and the first row has 6"),
        (GOOD.replace("#..D.#", "#..D#"), 3, 6, "the row has 5 cells and the first row has 6"),
        (GOOD.replace("#..D.#", ""), 3, 1, "the row has 0 cells and the first row has 6"),
        (GOOD.replace("#..D", "#.kD"), 3, 3, "'k' is not a map character"),
        (GOOD.replace("#..D", "#.\tD"), 3, 3, "'\\t' is not a map character"),
        ("\ufeff" + GOOD, 1, 1, "'\\ufeff' is not a map character"),
        (GOOD.replace("#..D", "...D"), 3, 1, "the outer border must be wall (#), not '.'"),
        (GOOD.replace("D.#", "D.G"), 3, 6, "the outer border must be wall (#), not 'G'"),
        ("###.##" + GOOD[6:], 1, 4, "the outer border must be wall (#), not '.'"),
        (GOOD[:-2] + ".", 4, 6, "the outer border must be wall (#), not '.'"),
    ],
)
def test_a_bad_map_is_refused_with_its_place(text: str, line: int, column: int, problem: str) -> None:
    with pytest.raises(LayoutError) as caught:
        parse_layout(text, "house.txt")
    assert str(caught.value).startswith(f"house.txt, line {line}, column {column}: {problem}")
    assert (caught.value.line, caught.value.column) == (line, column)


def test_a_door_believed_elsewhere_leaves_wall_behind() -> None:
    believed = parse_layout(GOOD).with_door_at((3, 1))
    assert str(believed) == GOOD.replace("K#G", "KDG").replace("..D", "..#")


@pytest.mark.parametrize("cell", [(1, 2), (0, 1), (5, 2), (3, 0), (3, 3), (9, 9), (3, 2)])
def test_a_door_can_be_believed_only_in_an_inner_wall(cell: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="inner wall"):
        parse_layout(GOOD).with_door_at(cell)
