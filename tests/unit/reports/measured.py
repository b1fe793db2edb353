"""A study with drives, predictions and a scale as the report takes it, answered by chance or by hand."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from webapp.reports.blocks import Cell, Section, Statement, Table
from webapp.reports.study_data import StudyData
from webapp.stimuli.sources import find_study
from webapp.study.analysis_plan import Contrast, Plan, default_contrasts
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study, parse_study

EXPERIMENT = "1"
KINDS = ("full", "none", "subgoals")
ITEMS = ("foresee", "general")
LAYOUTS = ("a", "b", "c")
OPTIMUM = 10

RATING_COLUMNS = ("participant", "experiment", "trial", "layout", "kind", "draw", "item", "rating", "response_time_ms")
DRIVE_COLUMNS = (
    *("participant", "experiment", "trial", "layout", "kind", "phase", "end", "num_steps", "optimum", "step_limit"),
)
PROBE_COLUMNS = (
    *("participant", "experiment", "trial", "layout", "kind", "question", "is_correct", "is_as_good", "confidence"),
)


def shipped(name: str) -> Study:
    return parse_study((find_study(name) / "study.toml").read_text(encoding="utf-8"))


def plan_of_kinds(kinds: Sequence[str] = KINDS, items: Sequence[str] = ITEMS, **changes: Any) -> Plan:  # noqa: ANN401
    kept: dict[str, Any] = {
        "contrasts": default_contrasts(EXPERIMENT, kinds) if kinds else (),
        "equivalences": (Contrast(EXPERIMENT, "subgoals", "full"),),
        "items": {EXPERIMENT: tuple(items)},
    }
    return Plan(**(kept | changes))


def data_of(
    ratings: Sequence[Sequence[Any]] = (),
    drives: Sequence[Sequence[Any]] | None = None,
    probes: Sequence[Sequence[Any]] | None = None,
    **changes: Any,  # noqa: ANN401 - whatever the field holds
) -> StudyData:
    """Return a study of the given rows; of ratings `participant, trial, layout, kind, item, rating`."""
    full = [
        (who, EXPERIMENT, trial, layout, kind, None, item, rating, 900)
        for who, trial, layout, kind, item, rating in ratings
    ]
    people = sorted({row[0] for row in (*ratings, *(drives or ()), *(probes or ()))})
    kept: dict[str, Any] = {
        "study": "measured",
        "study_version": "4d" * 32,
        "mode": "live",
        "ratings": _typed(pd.DataFrame(full, columns=list(RATING_COLUMNS))),
        "participants": pd.DataFrame({"participant": people}),
        "everybody": None,
        "answers": None,
        "probes": None if probes is None else _typed(pd.DataFrame(probes, columns=list(PROBE_COLUMNS))),
        "drives": None if drives is None else _typed(pd.DataFrame(drives, columns=list(DRIVE_COLUMNS))),
        "declared": None,
        "wordings": {},
        "points": {(EXPERIMENT, item): 5 for item in (*ITEMS, *SATISFACTION_ITEMS)},
        "plan": plan_of_kinds(),
    }
    return StudyData(**(kept | changes))


def by_chance(num_people: int = 40, seed: int = 1, *, scale: bool = False, **changes: Any) -> StudyData:  # noqa: ANN401
    """Return a study in which subgoals help, everybody drives before and after, and better people rate higher."""
    rng = np.random.default_rng(seed)
    ratings: list[tuple[Any, ...]] = []
    drives: list[tuple[Any, ...]] = []
    probes: list[tuple[Any, ...]] = []
    for number in range(num_people):
        who, own = f"p{number:04}", rng.normal(0, 1)
        for trial, kind in enumerate(np.roll(KINDS, number), 1):
            layout, skill = LAYOUTS[(trial + number // 3) % 3], own + 1.2 * (kind == "subgoals") + 0.3
            cell = (who, EXPERIMENT, trial, layout, str(kind))
            items = (*ITEMS, *(SATISFACTION_ITEMS if scale else ()))
            ratings += [(who, trial, layout, str(kind), item, _rating(skill + rng.normal())) for item in items]
            drives += [(*cell, "before", *_drive(own - 0.5, rng)), (*cell, "after", *_drive(skill, rng))]
            for question in (1, 2):
                right = bool(rng.random() < 1 / (1 + np.exp(-skill)))
                probes.append(
                    (*cell, question, right, right or bool(rng.random() < 0.2), _rating(skill + rng.normal()))
                )
    drives.append(("p0000", None, None, "practice", None, "practice", "reached", 12, 11, 55))
    return data_of(ratings, drives, probes, **changes)


def table(section: Section, name: str) -> list[dict[str, Cell]]:
    """Return the rows of a table by the names of its columns; none where there is no such table."""
    found = [block for block in section.blocks if isinstance(block, Table) and block.name == name]
    assert len(found) <= 1
    return [
        {column.name: cell for column, cell in zip(each.columns, row, strict=True)}
        for each in found
        for row in each.rows
    ]


def statements(section: Section) -> list[str]:
    """Return subject and reason of each statement."""
    return [f"{each.subject}: {each.reason}" for each in section.blocks if isinstance(each, Statement)]


def check_sound(section: Section) -> None:
    """See to it that names are unique, no cell is NaN or infinite, and assumptions tell what was found."""
    tables = [block for block in section.blocks if isinstance(block, Table)]
    names = [block.name for block in section.blocks if not isinstance(block, str | Statement)]
    assert len(set(names)) == len(names)
    for each in tables:
        assert each.rows
        for row in each.rows:
            for cell in row:
                assert cell is None or isinstance(cell, str | int | float | bool | np.integer | np.floating), cell
                assert not isinstance(cell, float | np.floating) or np.isfinite(cell), (each.name, row)
    for assumption in section.assumptions:
        assert "nan" not in assumption.check
        assert assumption.check
    for told in statements(section):
        assert "nan" not in told.replace("finan", "")


def _typed(frame: pd.DataFrame) -> pd.DataFrame:
    whole = {name: "Int64" for name in ("trial", "draw", "question", "confidence") if name in frame}
    for name in ("rating", "num_steps", "optimum", "step_limit"):
        if name in frame:
            whole[name] = "int64"
    if "phase" not in frame:
        whole["trial"] = "int64"
    logical = {name: "bool" for name in ("is_correct", "is_as_good") if name in frame}
    return frame.astype(whole | logical)


def _rating(latent: float) -> int:
    return int(np.clip(round(3 + latent), 1, 5))


def _drive(skill: float, rng: np.random.Generator) -> tuple[str, int, int, int]:
    if rng.random() < 1 / (1 + np.exp(-skill)):
        return "reached", OPTIMUM + int(rng.poisson(3)), OPTIMUM, 30
    return ("gave_up", int(rng.integers(0, 20)), OPTIMUM, 30) if rng.random() < 0.7 else ("step_limit", 30, OPTIMUM, 30)
