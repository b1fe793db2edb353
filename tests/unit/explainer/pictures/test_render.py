import hashlib
import subprocess
import sys
from io import BytesIO
from itertools import combinations, pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from tests.worlds import LAYOUTS, reachable_states
from webapp.explainer.pictures import tiles
from webapp.explainer.pictures.render import digest, draw
from webapp.explainer.worlds.view import Tile, View, egocentric_view

FLOOR_ROW = (Tile.FLOOR, Tile.FLOOR, Tile.FLOOR)
OPEN_FLOOR = View((FLOOR_ROW, FLOOR_ROW, FLOOR_ROW), has_key=False)
THINGS_AHEAD: list[Tile] = [tile for tile in Tile if tile is not Tile.UNSEEN]


def with_ahead(tile: Tile, *, has_key: bool = False) -> View:
    """A view with one thing directly ahead, which hides nothing since the floor beside it is open."""
    return View((FLOOR_ROW, (Tile.FLOOR, tile, Tile.FLOOR), FLOOR_ROW), has_key=has_key)


def standing_on(tile: Tile, *, has_key: bool) -> View:
    return View((FLOOR_ROW, FLOOR_ROW, (Tile.FLOOR, tile, Tile.FLOOR)), has_key=has_key)


def before_a_wall() -> View:
    return View(((Tile.UNSEEN,) * 3, (Tile.WALL,) * 3, FLOOR_ROW), has_key=False)


def pixels(view: View, mode: str = "RGB") -> NDArray[np.int64]:
    return np.asarray(Image.open(BytesIO(draw(view))).convert(mode)).astype(np.int64)


def cell(picture: NDArray[np.int64], row: int, column: int) -> NDArray[np.int64]:
    return picture[192 * row : 192 * (row + 1), 192 * column : 192 * (column + 1)]


def test_a_picture_has_two_pixels_per_css_pixel_and_a_palette() -> None:
    image = Image.open(BytesIO(draw(OPEN_FLOOR)))
    assert (image.format, image.mode, image.size) == ("PNG", "P", (576, 576))
    assert image.info == {}
    assert Image.open(BytesIO(draw(OPEN_FLOOR, 96))).size == (192, 192)


@pytest.mark.parametrize("size", [0, -3, 100])
def test_a_size_that_does_not_fit_three_cells_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=f"multiple of 3, not {size}"):
        draw(OPEN_FLOOR, size)


def test_a_picture_is_the_same_bytes_in_another_process() -> None:
    program = """
from webapp.explainer.pictures.render import digest, draw
from webapp.explainer.worlds.view import Tile, View
floor = (Tile.FLOOR,) * 3
draw(View((floor, (Tile.FLOOR, Tile.GOAL, Tile.FLOOR), floor), has_key=True))
print(digest(draw(View((floor, (Tile.FLOOR, Tile.KEY, Tile.FLOOR), floor), has_key=False))))
"""
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True)
    assert answer.stdout.strip() == digest(draw(with_ahead(Tile.KEY)))


def test_a_picture_takes_no_more_room_than_pillow_would_need_for_it() -> None:
    for view in (OPEN_FLOOR, before_a_wall(), *map(with_ahead, THINGS_AHEAD)):
        picture, buffer = draw(view), BytesIO()
        Image.open(BytesIO(picture)).save(buffer, format="PNG", compress_level=8)
        assert len(picture) < 1.02 * len(buffer.getvalue())


@pytest.mark.parametrize("size", [3, 24, 288])
def test_every_colour_of_a_picture_is_in_its_palette(size: int) -> None:
    for view in (OPEN_FLOOR, before_a_wall(), *map(with_ahead, THINGS_AHEAD)):
        image = Image.open(BytesIO(draw(view, size)))
        assert np.asarray(image).max() < len(image.getpalette() or []) // 3


def test_a_picture_is_named_by_its_sha256() -> None:
    assert digest(b"picture") == hashlib.sha256(b"picture").hexdigest()


def test_a_page_of_twenty_pictures_is_small() -> None:
    views = {egocentric_view(layout, state) for layout in LAYOUTS.values() for state in reachable_states(layout)}
    sizes = [len(draw(view)) for view in views]
    assert 20 * max(sizes) < 150_000
    assert len({digest(draw(view, 24)) for view in views}) == len(views)


@pytest.mark.parametrize("tile", [tile for tile in THINGS_AHEAD if tile is not Tile.FLOOR])
def test_a_thing_changes_its_own_cell_and_no_other(tile: Tile) -> None:
    changed = np.any(pixels(with_ahead(tile)) != pixels(OPEN_FLOOR), axis=2)
    assert np.count_nonzero(changed[192:384, 192:384]) > 1000
    changed[192:384, 192:384] = False
    assert not changed.any()


@pytest.mark.parametrize("ground", [Tile.FLOOR, Tile.OPEN_DOOR, Tile.GOAL])
def test_the_key_in_hand_shows_beside_the_agent_and_nowhere_else(ground: Tile) -> None:
    without, with_key = (pixels(standing_on(ground, has_key=has_key)) for has_key in (False, True))
    changed = np.any(without != with_key, axis=2)
    assert np.count_nonzero(changed[480:576, 288:384]) > 2000
    changed[480:576, 288:384] = False
    assert not changed.any()


def test_things_differ_without_colour() -> None:
    shades: dict[Tile, NDArray[np.int64]] = {tile: cell(pixels(with_ahead(tile), "L"), 1, 1) for tile in THINGS_AHEAD}
    shades[Tile.UNSEEN] = cell(pixels(before_a_wall(), "L"), 0, 1)
    for first, second in combinations(Tile, 2):
        difference = np.abs(shades[first] - shades[second])
        assert np.mean(difference > 40) > 0.05, (first, second)


def test_what_the_agent_stands_on_and_holds_differs_without_colour() -> None:
    shown = [
        cell(pixels(standing_on(ground, has_key=has_key), "L"), 2, 1)
        for ground in (Tile.FLOOR, Tile.OPEN_DOOR, Tile.GOAL)
        for has_key in (False, True)
    ]
    for first, second in combinations(shown, 2):
        assert np.mean(np.abs(first - second) > 40) > 0.03


def test_the_agent_points_up() -> None:
    red = np.abs(cell(pixels(OPEN_FLOOR), 2, 1) - np.array([220, 47, 60])).sum(axis=2) < 120
    rows = np.flatnonzero(red.any(axis=1))
    widths = [np.count_nonzero(red[row]) for row in np.linspace(rows[0], rows[-1], 8).astype(int)[:6]]
    assert all(above < below for above, below in pairwise(widths))


def test_bricks_and_hatching_run_on_into_the_next_cell() -> None:
    picture = pixels(before_a_wall())
    for row in (0, 1):
        assert np.array_equal(cell(picture, row, 0), cell(picture, row, 1))
        assert np.array_equal(cell(picture, row, 1), cell(picture, row, 2))
    hatch = cell(picture, 0, 1)
    jumps = np.abs(np.diff(np.concatenate([hatch, hatch], axis=1), axis=1)).sum(axis=(0, 2))
    assert jumps[191] < 1.5 * np.median(jumps)


def luminance(colour: str) -> float:
    """WCAG 2.2, relative luminance."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize(
    ("inside", "outside"),
    [
        (tiles.BRICK, tiles.FLOOR),
        (tiles.MORTAR, tiles.FLOOR),
        (tiles.HIDDEN, tiles.BRICK),
        (tiles.HATCH, tiles.HIDDEN),
        (tiles.UMBER, tiles.FLOOR),
        (tiles.UMBER, tiles.GOLD),
        (tiles.UMBER, tiles.BRICK),
        (tiles.UMBER, tiles.WHITE),
        (tiles.RED, tiles.FLOOR),
        (tiles.CRIMSON, tiles.FLOOR),
        (tiles.RED, tiles.WHITE),
        (tiles.GRASS, tiles.FLOOR),
        (tiles.MEADOW, tiles.FLOOR),
        (tiles.GRASS, tiles.WHITE),
        (tiles.MEADOW, tiles.WHITE),
    ],
)
def test_neighbouring_colours_contrast_at_least_three_to_one(inside: str, outside: str) -> None:
    dark, light = sorted([luminance(inside), luminance(outside)])
    assert (light + 0.05) / (dark + 0.05) >= 3
