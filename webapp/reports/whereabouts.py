"""Where each person got to, from what was drawn for them and how many pages they sent, as the dashboard counts it."""

from collections.abc import Iterator
from dataclasses import dataclass

import pandas as pd

from webapp.reports.study_data import StudyData
from webapp.storage.live_plans import Arm, CellKey, Plans


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """One person.

    Attributes:
        arms: By trial: experiment and kind.
        num_started: How many trials they reached.
        num_finished: How many of them they finished.
        has_left: Whether they withdrew.
        is_open: Whether they neither finished, nor withdrew, nor were screened out.
        page_kind: What the page at hand is; None after the last one.
        reason: Why they are not analysed; None if they are.
    """

    arms: tuple[Arm, ...]
    num_started: int
    num_finished: int
    has_left: bool
    is_open: bool
    page_kind: str | None
    reason: str | None

    @property
    def arm_at_hand(self) -> Arm | None:
        """Experiment and kind of the trial that was started and not finished."""
        return self.arms[self.num_started - 1] if self.num_started > self.num_finished else None


class Unknown(Exception):
    """Where people got to cannot be told; the message says why."""


def whereabouts(data: StudyData) -> tuple[Whereabouts, ...]:
    """Return where everybody got to, in the order of `data.everybody`.

    Raises:
        Unknown: There are no rows of participants, or no study file, or the two do not fit together.
    """
    if data.everybody is None:
        raise Unknown("the data set has no participants.csv, so nobody who left is known")
    if data.declared is None:
        left = int(data.everybody["completed_at"].isna().sum())
        raise Unknown(
            "the data set has no study file, so pages cannot be told from trials; "
            f"{left} of {len(data.everybody)} people did not finish"
        )
    plans = Plans(data.declared)
    return tuple(_where(plans, row) for row in _rows(data.everybody))


def _rows(everybody: pd.DataFrame) -> Iterator[dict[str, object]]:
    for row in everybody.to_dict("records"):
        yield {str(name): None if pd.isna(value) else value for name, value in row.items()}


def _where(plans: Plans, row: dict[str, object]) -> Whereabouts:
    cells = _cells(str(row["assignment"] or ""))
    if not cells:
        raise Unknown(f"no trials are told for the participant {row['participant']}")
    known = set(plans.cells)
    wrong = [cell for cell in cells if cell not in known]
    if wrong:
        raise Unknown(f"the study file has no trial {'/'.join(wrong[0])}, which was drawn for {row['participant']}")
    plan = plans.plan(cells)
    sent = int(str(row["num_pages_sent"] or 0))
    is_screened_out = row["screened_out_at"] is not None
    num_started = 0 if is_screened_out else plan.num_started(sent)
    return Whereabouts(
        arms=plan.arms,
        num_started=num_started,
        num_finished=min(num_started, plan.num_finished(sent)),
        has_left=row["withdrawn_at"] is not None,
        is_open=not is_screened_out and row["withdrawn_at"] is None and row["completed_at"] is None,
        page_kind=plan.page_kinds[sent] if sent < len(plan.page_kinds) and not is_screened_out else None,
        reason=None if row["reason"] is None else str(row["reason"]),
    )


def _cells(assignment: str) -> tuple[CellKey, ...]:
    """Read experiment, kind and layout of each trial from `experiment/layout/kind` or `experiment/layout/kind/draw`."""
    parts = [trial.split("/") for trial in assignment.split()]
    return tuple((each[0], each[2], each[1]) for each in parts if len(each) > 2)  # noqa: PLR2004 - three names
