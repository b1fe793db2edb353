"""The registered plan beside what was run, line by line."""

from collections.abc import Sequence

from webapp.reports.blocks import Block, Cell, Column, Section, Statement, Table
from webapp.reports.departures import nothing_differs
from webapp.reports.findings import Finding
from webapp.reports.formatting import counted, number
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Contrast, Plan

_TESTS = (
    Column("experiment", "Experiment"),
    Column("contrast", "Planned comparison"),
    Column("item", "Item"),
    Column("was_run", "Run"),
    Column("reason", "Why not"),
)
_SETTINGS = (Column("setting", "Setting"), Column("planned", "Planned"), Column("source", "From"))


def plan_and_run(data: StudyData, found: Sequence[Finding], differences: Sequence[str]) -> Section:
    """Return the plan, what was run of it, and what differs.

    Args:
        data: What was analysed, with its plan.
        found: What came of the planned comparisons.
        differences: From the plan, as sentences.
    """
    blocks: list[Block] = [*_registered(data.plan), _settings(data)]
    if found:
        blocks.append(_tests(found))
    if differences:
        blocks.append("\n".join(["What differs:", *(f"\N{BULLET} {each}" for each in differences)]))
    else:
        blocks.append(nothing_differs(data))
    return Section("plan", "The plan and what was run", tuple(blocks))


_DECLARED = (
    "The comparisons are declared in the study file, which is frozen under the version's hash, and every row of the "
    "data carries that hash. There is no plan in words beside them."
)


def _registered(plan: Plan) -> list[Block]:
    if plan.text is None and plan.is_declared:
        return [_DECLARED]
    if plan.text is None:
        return [
            Statement(
                "the registered plan in words",
                "The study file names no plan, or the data set does not hold it, so there is no text to compare with. "
                "Nothing here can show that the analysis was decided before the data were seen.",
            )
        ]
    return [
        "The plan as it was registered with the study (plan.txt beside this report), frozen under the version's hash:",
        plan.text,
    ]


def _settings(data: StudyData) -> Table:
    plan = data.plan
    declared = (
        set() if data.declared is None or data.declared.analysis is None else data.declared.analysis.model_fields_set
    )
    items = [
        (f"items of experiment {each}", ", ".join(names), _source("items" in declared))
        for each, names in sorted(plan.items.items())
    ]
    rows: list[tuple[Cell, ...]] = [
        ("comparisons of kinds", _told(plan.contrasts), _source(plan.is_declared)),
        ("pairs tested for equivalence", _told(plan.equivalences), _source("equivalences" in declared)),
        *items,
        ("level of the family", number(plan.alpha), _source("alpha" in declared)),
        ("margin of equivalence", f"\N{PLUS-MINUS SIGN}{plan.margin:g} points", _source(plan.is_margin_declared)),
        ("size of the family", counted(plan.num_tests, "test"), "comparisons times items"),
    ]
    return Table("plan", "What is tested", _SETTINGS, tuple(rows))


def _source(is_declared: bool) -> str:  # noqa: FBT001 - it reads well where it is called.
    return "the study file" if is_declared else "the default plan"


def _told(contrasts: Sequence[Contrast]) -> str:
    return "; ".join(f"experiment {each.experiment}: {each}" for each in contrasts) or "none"


def _tests(found: Sequence[Finding]) -> Table:
    rows = tuple(
        (each.contrast.experiment, str(each.contrast), each.item, not each.reason, each.reason) for each in found
    )
    return Table("plan_and_run", "Each planned comparison, and whether it was run", _TESTS, rows)
