"""The drawings that pictures are put together from: one per thing in a cell, and the agent over what it stands on.

Nothing is told by colour alone: walls are bricks, hidden cells are hatched, the goal is chequered and flagged, a
locked door bears a padlock, an open one is a frame with the floor in it, the agent is an arrowhead, and the key in
its hand is a round badge beside it. Neighbouring things differ at least 3:1 in contrast, or have an outline that does
(WCAG 2.2, 1.4.11).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from PIL import Image, ImageDraw

from webapp.explainer.worlds.view import Tile

UNIT = 192
"""The edge of a tile in the units in which it is drawn."""

Point = tuple[float, float]

FLOOR, FLOOR_LINE = "#f1f4f8", "#cdd5df"
BRICK, MORTAR = "#738095", "#4f5b6d"
HIDDEN, HATCH = "#12161d", "#596579"
GOLD, BRONZE, UMBER = "#fbbf24", "#d99a0b", "#3f2a06"
GRASS, MEADOW, PINE = "#187a49", "#369f6b", "#0b3d26"
RED, CRIMSON = "#dc2f3c", "#ae1a29"
WHITE = "#ffffff"


@dataclass(frozen=True, slots=True)
class Pen:
    """Draws shapes given in units of a tile, at any scale, turned and moved.

    Attributes:
        surface: Where to draw.
        scale: Pixels per unit.
        origin: Where the shapes' (0, 0) lies, in units of the tile.
        angle: Degrees by which shapes are turned about their (0, 0), clockwise.
        zoom: How many units of the tile a unit of the shapes takes.
    """

    surface: ImageDraw.ImageDraw
    scale: float
    origin: Point = (0, 0)
    angle: float = 0
    zoom: float = 1

    def at(self, origin: Point, angle: float = 0, zoom: float = 1) -> "Pen":
        """Return a pen that draws about another origin, turned and zoomed."""
        return replace(self, origin=origin, angle=angle, zoom=zoom)

    def polygon(self, points: Sequence[Point], fill: str, swell: float = 0) -> None:
        """Fill a polygon, swollen by a margin with round corners (in units of the shape)."""
        pixels = [self._pixel(point) for point in points]
        self.surface.polygon(pixels, fill=fill)
        if swell:
            radius = swell * self.scale * self.zoom
            self.surface.line([*pixels, pixels[0]], fill=fill, width=round(2 * radius))
            for x, y in pixels:
                self.surface.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill)

    def rectangle(self, left: float, top: float, right: float, bottom: float, fill: str, swell: float = 0) -> None:
        """Fill a rectangle, swollen by a margin with round corners."""
        self.polygon([(left, top), (right, top), (right, bottom), (left, bottom)], fill, swell)

    def circle(self, centre: Point, radius: float, fill: str) -> None:
        """Fill a circle."""
        x, y = self._pixel(centre)
        reach = radius * self.scale * self.zoom
        self.surface.ellipse((x - reach, y - reach, x + reach, y + reach), fill=fill)

    def _pixel(self, point: Point) -> Point:
        turn = math.radians(self.angle)
        x, y = (self.zoom * part for part in point)
        turned = (x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn))
        return (self.origin[0] + turned[0]) * self.scale, (self.origin[1] + turned[1]) * self.scale


def draw_tile(tile: Tile, edge: int) -> Image.Image:
    """Draw what is seen in one cell, `edge` pixels wide and high, with hard edges: sample down for smooth ones."""
    image, pen = _canvas(edge)
    _DRAWINGS[tile](pen)
    return image


def draw_agent(underfoot: Tile, edge: int, *, has_key: bool) -> Image.Image:
    """Draw the agent facing up over what it stands on, with the key in hand or not; see `draw_tile`."""
    image, pen = _canvas(edge)
    _GROUNDS.get(underfoot, _DRAWINGS[underfoot])(pen)
    _arrowhead(pen, WHITE, swell=16)
    _arrowhead(pen, RED, swell=8)
    shade = image.copy()
    _arrowhead(replace(pen, surface=ImageDraw.Draw(shade)), CRIMSON, swell=8)
    image.paste(shade.crop((edge // 2, 0, edge, edge)), (edge // 2, 0))
    if has_key:
        _badge(pen)
    return image


def _canvas(edge: int) -> tuple[Image.Image, Pen]:
    image = Image.new("RGB", (edge, edge), FLOOR)
    return image, Pen(ImageDraw.Draw(image), edge / UNIT)


def _floor(pen: Pen) -> None:
    pen.rectangle(0, 0, UNIT, UNIT, FLOOR_LINE)
    pen.rectangle(12, 12, UNIT - 12, UNIT - 12, FLOOR, swell=10)


def _wall(pen: Pen) -> None:
    """Four courses of bricks that run on into the neighbouring walls."""
    pen.rectangle(0, 0, UNIT, UNIT, MORTAR)
    for course in range(4):
        for brick in range(-1, 3):
            left, top = 96 * brick + 48 * (course % 2), 48 * course
            pen.rectangle(left + 6, top + 6, left + 90, top + 42, BRICK, swell=3)


def _unseen(pen: Pen) -> None:
    """Slanting lines that run on into the neighbouring hidden cells."""
    pen.rectangle(0, 0, UNIT, UNIT, HIDDEN)
    for left in range(-UNIT, UNIT, 48):
        pen.polygon([(left, UNIT), (left + 12, UNIT), (left + 12 + UNIT, 0), (left + UNIT, 0)], HATCH)


def _key(pen: Pen) -> None:
    _floor(pen)
    _key_shape(pen.at((UNIT / 2, UNIT / 2), angle=45))


def _key_shape(pen: Pen) -> None:
    """A key 132 units long with its bow up, in gold with a dark outline."""
    for colour, swell in ((UMBER, 9), (GOLD, 2)):
        pen.circle((0, -36), 28 + swell, colour)
        pen.rectangle(-6, -10, 6, 62, colour, swell)
        pen.rectangle(6, 28, 22, 36, colour, swell)
        pen.rectangle(6, 52, 26, 60, colour, swell)
    pen.circle((0, -36), 17, UMBER)
    pen.circle((0, -36), 10, FLOOR)


def _closed_door(pen: Pen) -> None:
    pen.rectangle(0, 0, UNIT, UNIT, UMBER)
    pen.rectangle(18, 18, UNIT - 18, UNIT - 18, GOLD, swell=4)
    pen.rectangle(34, 34, UNIT - 34, UNIT - 34, BRONZE, swell=4)
    pen.rectangle(40, 40, UNIT - 40, UNIT - 40, GOLD, swell=4)
    _padlock(pen.at((UNIT / 2, UNIT / 2 + 8)))


def _padlock(pen: Pen) -> None:
    pen.circle((0, -26), 28, UMBER)
    pen.circle((0, -26), 15, GOLD)
    pen.rectangle(-28, -26, 28, 0, UMBER)
    pen.rectangle(-15, -26, 15, 0, GOLD)
    pen.rectangle(-32, -6, 32, 38, UMBER, swell=6)
    pen.circle((0, 9), 9, GOLD)
    pen.polygon([(-4, 9), (4, 9), (7, 29), (-7, 29)], GOLD)


def _open_door(pen: Pen) -> None:
    """The frame of the door with the floor in it, and the door itself swung aside."""
    _door_frame(pen)
    leaf = [(26, 26), (58, 50), (58, UNIT - 12), (26, UNIT - 26)]
    pen.polygon(leaf, UMBER, swell=6)
    pen.polygon(leaf, GOLD)
    pen.circle((49, 108), 6, UMBER)


def _door_frame(pen: Pen) -> None:
    pen.rectangle(0, 0, UNIT, UNIT, UMBER)
    pen.rectangle(14, 14, UNIT - 14, UNIT - 14, GOLD)
    pen.rectangle(26, 26, UNIT - 26, UNIT - 26, UMBER)
    pen.rectangle(32, 32, UNIT - 32, UNIT - 32, FLOOR)


def _goal(pen: Pen) -> None:
    _goal_ground(pen)
    for colour, swell in ((PINE, 8), (WHITE, 0)):
        pen.rectangle(60, 38, 66, 156, colour, swell)
        pen.polygon([(66, 40), (138, 70), (66, 100)], colour, swell)


def _goal_ground(pen: Pen) -> None:
    pen.rectangle(0, 0, UNIT, UNIT, GRASS)
    for row in range(4):
        for column in range(row % 2, 4, 2):
            pen.rectangle(48 * column, 48 * row, 48 * column + 48, 48 * row + 48, MEADOW)


def _arrowhead(pen: Pen, fill: str, swell: float) -> None:
    pen.polygon([(96, 38), (140, 140), (96, 120), (52, 140)], fill, swell)


def _badge(pen: Pen) -> None:
    centre = (148, 148)
    pen.circle(centre, 42, WHITE)
    pen.circle(centre, 37, UMBER)
    pen.circle(centre, 32, WHITE)
    _key_shape(pen.at(centre, angle=45, zoom=0.4))


_DRAWINGS = {
    Tile.UNSEEN: _unseen,
    Tile.WALL: _wall,
    Tile.FLOOR: _floor,
    Tile.KEY: _key,
    Tile.CLOSED_DOOR: _closed_door,
    Tile.OPEN_DOOR: _open_door,
    Tile.GOAL: _goal,
}
_GROUNDS = {Tile.OPEN_DOOR: _door_frame, Tile.GOAL: _goal_ground}
"""What is drawn under the agent, where it is not the whole drawing of the cell."""
