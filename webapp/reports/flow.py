"""Who is analysed: the flow of participants in the manner of CONSORT, exclusion rules, corrections."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import cast

import pandas as pd

from webapp.reports.blocks import Block, Cell, Column, Drawing, Section, Statement, Table
from webapp.reports.formatting import counted
from webapp.reports.read_exclusions import INCOMPLETE
from webapp.reports.read_folder import DataFiles
from webapp.reports.selection import Selection
from webapp.reports.study_data import StudyData
from webapp.storage.consort import Counts, Fate, Flow, steps
from webapp.storage.consort_figure import draw_flows
from webapp.storage.scope import Mode, Scope
from webapp.study.quality import RULES, Rule, rule_words

_STEPS = {
    "allocated": "agreed and allocated",
    "withdrawn": "left the study",
    "screened_out": "screened out by the quiz",
    "in_progress": "began and did not finish",
    "completed": "completed",
    "excluded": "excluded after completing",
    "included": "did not complete and analysed all the same",
    "analysed": "analysed",
}


def section(data: StudyData, selection: Selection | None = None) -> Section:
    """Tell who is analysed.

    Args:
        data: What is analysed.
        selection: How it was chosen; without it there are no arrangements, rules and corrections in the section.
    """
    flow = flow_of(data, None if selection is None else selection.allocation)
    files = DataFiles() if selection is None else selection.files
    blocks: list[Block] = []
    if flow is None:
        people, ratings = counted(len(data.participants), "participant"), counted(len(data.ratings), "rating")
        reason = f"the data set has no {files.name_of('participants')}; {people} with {ratings} are analysed"
        blocks.append(Statement("The flow of participants", reason))
    else:
        sentence = _sentence(flow)
        blocks += [sentence, _drawing(flow, sentence), _steps_table(flow), *_kinds_table(flow)]
    if selection is not None:
        blocks += [*_rules_table(selection), *_corrections_table(selection), *selection.notes]
    return Section("flow", "Who is analysed", tuple(blocks))


def flow_of(data: StudyData, allocation: pd.DataFrame | None = None) -> Flow | None:
    """Count the flow of participants.

    Args:
        data: What is analysed.
        allocation: Of `allocation.csv`: which arrangement was drawn, and how many were erased; None for neither.

    Returns:
        The flow; None if the data do not say who took part.
    """
    if data.everybody is None:
        return None
    flow = Flow(Scope(data.study, data.study_version, cast("Mode", data.mode)))
    placed = _placed(allocation)
    flow.num_erased = _num_erased(allocation)
    for person in data.everybody.to_dict("records"):
        told = {str(name): None if pd.isna(value) else value for name, value in person.items()}
        shown = _shown(str(told.get("assignment") or ""))
        cells = [cell for cell in placed.get(str(told["participant"]), ()) if cell[0] in shown]
        flow.kinds_of |= {cell: tuple(shown[cell[0]]) for cell in cells if cell not in flow.kinds_of}
        kinds = sorted({(experiment, kind) for experiment, all_kinds in shown.items() for kind in all_kinds})
        for counts in (
            flow.everybody,
            *(flow.arrangements.setdefault(cell, Counts()) for cell in cells),
            *(flow.kinds.setdefault(kind, Counts()) for kind in kinds),
        ):
            counts.take(fate := _fate(told), _reason(data, told.get("reason")))
            counts.included += fate != "completed" and told.get("reason") is None
    return flow


def _fate(told: dict[str, object]) -> Fate:
    if told.get("withdrawn_at") is not None:
        return "withdrawn"
    if told.get("screened_out_at") is not None:
        return "screened_out"
    return "in_progress" if told.get("completed_at") is None else "completed"


def _reason(data: StudyData, reason: object) -> str | None:
    """Return a reason in words; that somebody did not complete is told by where they went."""
    return None if reason in (None, INCOMPLETE) else _words(data, str(reason))


def _words(data: StudyData, rule: str) -> str:
    quality = None if data.declared is None else data.declared.quality
    is_declared = quality is not None and rule in RULES and getattr(quality, rule) not in (None, False)
    return rule_words(quality, cast("Rule", rule)) if quality is not None and is_declared else rule


def _shown(assignment: str) -> dict[str, list[str]]:
    """Return the kinds of each experiment in the order in which they were drawn."""
    shown: dict[str, list[str]] = {}
    for trial in assignment.split():
        experiment, _, rest = trial.partition("/")
        kind = rest.partition("/")[2].partition("/")[0]
        if kind:
            shown.setdefault(experiment, []).append(kind)
    return shown


def _placed(allocation: pd.DataFrame | None) -> dict[str, list[tuple[str, int, int]]]:
    """Return by participant the arrangement and the order of layouts that were drawn in each experiment."""
    placed: dict[str, dict[str, tuple[str, int, int]]] = {}
    if allocation is not None:
        columns = ["participant", "experiment", "arrangement", "layout_order"]
        for person, experiment, arrangement, order in allocation[columns].dropna().itertuples(index=False):
            placed.setdefault(str(person), {})[str(experiment)] = (str(experiment), int(arrangement), int(order))
    return {person: list(cells.values()) for person, cells in placed.items()}


def _num_erased(allocation: pd.DataFrame | None) -> int:
    """Count the draws that belong to nobody any more."""
    return 0 if allocation is None else int(allocation.loc[allocation["participant"].isna(), "record"].nunique())


def _sentence(flow: Flow) -> str:
    counts = flow.everybody
    told = [
        f"{counted(counts.allocated, 'participant')} agreed and got an arrangement of kinds",
        f"{counts.dropped} of them did not complete the study",
        f"{counts.fates['completed']} did",
        f"{counts.excluded.total()} of these were excluded, which leaves {counts.analysed - counts.included}",
    ]
    others = (
        f" With {counts.included} who did not complete it, {counts.analysed} are analysed." if counts.included else ""
    )
    erased = f" Besides these, {flow.num_erased} were erased at their own wish." if flow.num_erased else ""
    return f"{'; '.join(told)}.{others}{erased} Exclusions were decided without looking at kinds of explanation."


def _drawing(flow: Flow, sentence: str) -> Drawing:
    return Drawing("consort", "The flow of participants", sentence, draw_flows([flow]))


def _steps_table(flow: Flow) -> Table:
    columns = (Column("step", "Step"), Column("reason", "Reason"), Column("n", "People", "count"))
    rows = tuple((_STEPS[step], reason, n) for step, reason, n in steps(flow.everybody))
    return Table("flow", "The flow of participants in numbers", columns, rows)


def _kinds_table(flow: Flow) -> Iterator[Table]:
    if not flow.kinds:
        return
    columns = (
        Column("experiment", "Experiment"),
        Column("kind", "Kind"),
        Column("allocated", "Allocated", "count"),
        Column("completed", "Completed", "count"),
        Column("excluded", "Excluded", "count"),
        Column("analysed", "Analysed", "count"),
    )
    rows = tuple(
        (*key, counts.allocated, counts.fates["completed"], counts.excluded.total(), counts.analysed)
        for key, counts in sorted(flow.kinds.items())
    )
    note = "Everybody counts with each kind that was drawn for them."
    yield Table("flow_by_kind", "The flow by kind of explanation", columns, rows, note)


def _rules_table(selection: Selection) -> Iterator[Block]:
    decided = selection.decided
    if not selection.rules:
        yield "No exclusion rule was applied."
        return
    reasons = Counter(decided.reasons.dropna())
    columns = (
        Column("rule", "Rule"),
        Column("words", "What it says"),
        Column("flagged", "Flagged", "count"),
        Column("left_out", "Left out for it", "count"),
    )
    rows: list[tuple[Cell, ...]] = [
        (rule, _words(selection.data, rule), decided.flagged[rule], reasons[rule] if rule != INCOMPLETE else None)
        for rule in selection.rules
    ]
    note = "Whoever did not complete is left out for that; of several rules the first one counts."
    yield Table("exclusion_rules", "Exclusion rules, declared before there were data", columns, tuple(rows), note)


def _corrections_table(selection: Selection) -> Iterator[Block]:
    made: Sequence[tuple[Cell, ...]] = [
        (each.participant, each.file, each.question, each.before, each.after, each.reason)
        for each in selection.corrections
        if each.problem is None
    ]
    if not made:
        return
    headings = ("Participant", "File", "Question", "Answered", "Corrected to", "Reason")
    columns = tuple(Column(heading.lower().replace(" ", "_"), heading) for heading in headings)
    note = "Of several corrections of an answer the last one stands."
    yield Table("corrections", "Corrections by researchers", columns, tuple(made), note)
