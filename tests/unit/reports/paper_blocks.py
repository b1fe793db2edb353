"""What a section of the paper's analysis shows, to ask it about its numbers, and data that are scarce or odd."""

import math
from collections.abc import Mapping

import pandas as pd
from hypothesis import strategies as st

from webapp.explainer.pictures.figure_style import drawn
from webapp.reports.blocks import Cell, Figure, Section, Statement, Table

ITEMS = ("likeliness", "loveliness", "general")
_KINDS = {"1": ("full", "subgoals", "random"), "2": ("all_key_points", "first_key_point")}


def rows_of(section: Section, name: str) -> list[dict[str, Cell]]:
    """Return a table's rows by column."""
    table = next(block for block in section.blocks if isinstance(block, Table) and block.name == name)
    return [dict(zip((column.name for column in table.columns), row, strict=True)) for row in table.rows]


def names_of(section: Section) -> list[str]:
    return [block.name for block in section.blocks if isinstance(block, Table | Figure)]


def reasons_of(section: Section) -> Mapping[str, str]:
    return {block.subject: block.reason for block in section.blocks if isinstance(block, Statement)}


def text_of(section: Section) -> str:
    return "\n".join(block for block in section.blocks if isinstance(block, str))


def check_is_sound(section: Section) -> None:
    """Fail if a number is nan or infinite, a p value is no probability, or a name comes twice."""
    names = names_of(section)
    assert len(set(names)) == len(names)
    for block in section.blocks:
        if isinstance(block, Table):
            for row in block.rows:
                for cell, column in zip(row, block.columns, strict=True):
                    assert type(cell) in (str, int, float, bool, type(None)), (block.name, column.name, type(cell))
                    assert not isinstance(cell, float) or math.isfinite(cell), (block.name, column.name)
                    if column.kind == "p" and isinstance(cell, float):
                        assert 0 <= cell <= 1
    for told in section.assumptions:
        assert "nan" not in told.check


def draw_all(section: Section) -> dict[str, bytes]:
    return {
        block.name: drawn(block.fill, block.size, ".svg", block.name)
        for block in section.blocks
        if isinstance(block, Figure)
    }


@st.composite
def small_frames(draw: st.DrawFn) -> pd.DataFrame:
    """Ratings of a few people in one or two experiments, of which many are missing, and often all equal."""
    highest = draw(st.sampled_from([1, 2, 5]))
    rows = []
    for experiment in draw(st.sampled_from([("1",), ("2",), ("1", "2"), ()])):
        for person in range(draw(st.integers(0, 6))):
            for trial, kind in enumerate(_KINDS[experiment], start=1):
                for item in ITEMS:
                    if draw(st.integers(0, 9)):
                        rating = draw(st.integers(1, highest))
                        rows.append((f"p{person}", experiment, trial, "a", kind, item, rating))
    names = ["participant", "experiment", "trial", "layout", "kind", "item", "rating"]
    frame = pd.DataFrame(rows, columns=names)
    return frame.astype({"rating": "int64", "trial": "int64"})
