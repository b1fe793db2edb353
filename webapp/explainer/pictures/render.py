"""A view as a picture: a PNG of 3 x 3 tiles, the same bytes for the same view."""

import hashlib
from functools import lru_cache
from typing import cast

from PIL import Image

from webapp.explainer.pictures.png import Band, compress, stack
from webapp.explainer.pictures.tiles import draw_agent, draw_tile
from webapp.explainer.worlds.view import AGENT, SIZE, Tile, View

CSS_SIZE = 288
"""The usual edge of a picture on a page, in CSS pixels."""

DENSITY = 2
"""Pixels of a picture per CSS pixel each way, so that it is sharp on screens of double density."""

_SAMPLES = 4
"""Each pixel of a tile is the mean of this many samples each way."""

_NUM_COLOURS = 48
"""The flat colours and enough of their mixtures for smooth edges."""

_AgentTile = tuple[Tile, bool]
"""What the agent stands on, and whether it holds the key."""

_Row = tuple[Tile | _AgentTile, ...]
"""A row of a picture, in tiles; the agent's own cell is what it stands on and whether it holds the key."""


def draw(view: View, size: int = CSS_SIZE) -> bytes:
    """Draw a view.

    Args:
        view: What the agent sees.
        size: The edge at which the picture is to be shown, in CSS pixels, a multiple of 3; it has `DENSITY` times as
            many pixels of its own.

    Returns:
        A PNG with a palette, without metadata. Equal views give equal bytes, and different views different ones.

    Raises:
        ValueError: The size is not a positive multiple of 3.
    """
    if size <= 0 or size % SIZE:
        raise ValueError(f"the size of a picture must be a positive multiple of {SIZE}, not {size}")
    edge = DENSITY * size // SIZE
    return stack([_band(row, edge) for row in _rows(view)], _palette(edge))


def digest(png: bytes) -> str:
    """Return the name of a picture: the SHA-256 of its bytes, as 64 hexadecimal digits."""
    return hashlib.sha256(png).hexdigest()


def _rows(view: View) -> list[_Row]:
    own_row, own_column = AGENT
    rows: list[_Row] = list(view.cells)
    own = (view.cells[own_row][own_column], view.has_key)
    rows[own_row] = (*rows[own_row][:own_column], own, *rows[own_row][own_column + 1 :])
    return rows


@lru_cache(maxsize=1024)
def _band(row: _Row, edge: int) -> Band:
    """Draw and compress a row of tiles: the views of a world are put together from few."""
    tiles = _tiles(edge)
    band = Image.new("P", (SIZE * edge, edge))
    for column, name in enumerate(row):
        band.paste(tiles[name], (column * edge, 0))
    return compress(band)


@lru_cache(maxsize=4)
def _sheet(edge: int) -> tuple[tuple[Tile | _AgentTile, ...], Image.Image]:
    """Draw every tile there is, side by side, so that all pictures share one palette."""
    agents = [(tile, has_key) for tile in (Tile.FLOOR, Tile.OPEN_DOOR, Tile.GOAL) for has_key in (False, True)]
    names: tuple[Tile | _AgentTile, ...] = (*Tile, *agents)
    sheet = Image.new("RGB", (edge * len(names), edge))
    for i, name in enumerate(names):
        samples = edge * _SAMPLES
        fine = draw_tile(name, samples) if isinstance(name, Tile) else draw_agent(name[0], samples, has_key=name[1])
        sheet.paste(fine.reduce(_SAMPLES), (i * edge, 0))
    return names, _with_palette(sheet)


def _with_palette(sheet: Image.Image) -> Image.Image:
    """Map an image to its own most frequent colours, which keeps its flat colours exact."""
    counted = sheet.getcolors(maxcolors=sheet.width * sheet.height) or []
    frequent = sorted(counted, key=lambda entry: (-entry[0], entry[1]))[:_NUM_COLOURS]
    palette = Image.new("P", (1, 1))
    palette.putpalette([part for _, colour in frequent for part in cast("tuple[int, int, int]", colour)])
    return sheet.quantize(palette=palette, dither=Image.Dither.NONE)


@lru_cache(maxsize=4)
def _tiles(edge: int) -> dict[Tile | _AgentTile, Image.Image]:
    names, sheet = _sheet(edge)
    return {name: sheet.crop((i * edge, 0, (i + 1) * edge, edge)) for i, name in enumerate(names)}


def _palette(edge: int) -> bytes:
    return bytes((_sheet(edge)[1].getpalette() or [])[: 3 * _NUM_COLOURS])
