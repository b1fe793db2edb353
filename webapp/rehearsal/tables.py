"""What a rehearsal leaves behind as tables."""

from collections.abc import Sequence
from dataclasses import fields

from webapp.rehearsal.beside_ratings import Shown
from webapp.rehearsal.calibration import Calibration
from webapp.rehearsal.verdicts import Verdict
from webapp.reports.blocks import Cell, Column, Table
from webapp.reports.csv_tables import csv_of


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Lay out a row for each planned test."""
    columns = (
        Column("experiment", "Experiment"),
        Column("contrast", "Contrast"),
        Column("item", "Item"),
        Column("planted", "Planted d", "number"),
        Column("d", "Found", "number"),
        Column("simultaneous_low", "From", "number"),
        Column("simultaneous_high", "To", "number"),
        Column("p_holm", "p (Holm)", "p"),
        Column("verdict", "Verdict"),
    )
    return Table("rehearsal", "Planted and found", columns, tuple(_verdict_row(verdict) for verdict in verdicts))


def _verdict_row(verdict: Verdict) -> tuple[Cell, ...]:
    contrast = verdict.contrast
    numbers = (verdict.planted, verdict.d, verdict.low, verdict.high, verdict.p_holm)
    return (contrast.experiment, str(contrast), verdict.item, *numbers, verdict.word)


def beside_table(found: Sequence[Shown]) -> Table:
    """Lay out what is shown beside the planned tests."""
    columns = (
        Column("experiment", "Exp."),
        Column("what", "Of what"),
        Column("name", "Of which"),
        Column("planted", "Planted", "number"),
        Column("found", "Found", "number"),
        Column("low", "From", "number"),
        Column("high", "To", "number"),
        Column("note", "Note"),
    )
    rows = tuple(tuple(getattr(each, field.name) for field in fields(Shown)) for each in found)
    return Table("beside", "Beside the planned tests, for orientation", columns, rows)


def promise_table(found: Calibration) -> Table:
    """Lay out a row for each share that was counted."""
    columns = (
        Column("share_of", "Share of"),
        Column("count", "Count", "count"),
        Column("total", "Of", "count"),
        Column("share", "Share", "number", 3),
        Column("low", "From", "number", 3),
        Column("high", "To", "number", 3),
        Column("promised", "Promised", "number"),
        Column("verdict", "Verdict"),
    )
    rows = tuple(
        (each.name, each.num, each.total, each.share, each.low, each.high, each.promised, each.word)
        for each in found.promises
    )
    return Table("calibration", "What the planned analysis promises, and what it does", columns, rows)


def calibration_files(found: Calibration) -> dict[str, bytes]:
    """Return the shares, and every test of every study, as CSV files by name."""
    tests: str = found.rows.to_csv(index=False, float_format="%.10g", lineterminator="\n")
    return {"calibration.csv": csv_of(promise_table(found)), "tests.csv": tests.encode()}
