"""Whether people leave during one kind of explanation more often than during another."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from webapp.reports.blocks import Assumption, Block, Column, Section, Statement, Table
from webapp.reports.formatting import counted
from webapp.reports.kind_outcomes import kinds_of
from webapp.reports.study_data import StudyData
from webapp.reports.whereabouts import Unknown, Whereabouts, whereabouts
from webapp.study.attrition import LEAST_EXPECTED, DropOutTest, compare_drop_out
from webapp.study.intervals import wilson_interval


@dataclass(frozen=True, slots=True)
class _Flow:
    """The trials of one kind in one experiment."""

    experiment: str
    kind: str
    started: int
    finished: int
    withdrawn: int
    silent: int

    @property
    def dropped(self) -> int:
        return self.withdrawn + self.silent


def section(data: StudyData) -> Section:
    """Return the section."""
    title = "Differential drop-out"
    try:
        people = whereabouts(data)
    except Unknown as unknown:
        return Section("drop_out", title, (Statement("Drop-out by kind", str(unknown)),))
    flows = _flows(data, people)
    if not any(flow.started for flow in flows):
        reason = f"none of {counted(len(people), 'person', 'people')} reached a trial"
        return Section("drop_out", title, (_ends(people), Statement("Drop-out by kind", reason)))
    seed = data.declared.seed if data.declared is not None else 0
    tests, statements = _tests(flows, seed)
    blocks: list[Block] = [_introduction(), _ends(people), _table(flows)]
    if tests:
        blocks.append(_test_table(tests))
    blocks += statements
    return Section("drop_out", title, tuple(blocks), _assumptions(flows, tests))


def _introduction() -> str:
    return (
        "If people leave during one kind more often than during another, those who are left are no longer alike "
        "(Zhou and Fishbach 2016). Everybody who agreed counts here, also those who are not analysed. A drop-out is "
        "put down to the trial that was under way; whoever was screened out or left before the first trial counts "
        "nowhere."
    )


def _ends(people: Sequence[Whereabouts]) -> str:
    before = sum((each.has_left or each.is_open) and not each.num_started for each in people)
    withdrawn = sum(each.has_left and each.arm_at_hand is not None for each in people)
    silent = sum(each.is_open and each.arm_at_hand is not None for each in people)
    told = (
        f"Of {counted(len(people), 'person', 'people')}, {withdrawn} said during a trial that they leave, {silent} "
        f"stopped without a word during one, and {before} did either before the first."
    )
    if silent:
        told += (
            " Whoever stopped without a word counts as having dropped out; if they were under way when the data were "
            "taken, which these data do not tell, that is too many."
        )
    return told


def _flows(data: StudyData, people: Sequence[Whereabouts]) -> list[_Flow]:
    started = Counter(arm for each in people for arm in each.arms[: each.num_started])
    finished = Counter(arm for each in people for arm in each.arms[: each.num_finished])
    withdrawn = Counter(each.arm_at_hand for each in people if each.has_left and each.arm_at_hand is not None)
    silent = Counter(each.arm_at_hand for each in people if each.is_open and each.arm_at_hand is not None)
    declared = [each.id for each in data.declared.experiments] if data.declared is not None else []
    return [
        _Flow(experiment, kind, *(count[experiment, kind] for count in (started, finished, withdrawn, silent)))
        for experiment in declared
        for kind in kinds_of(data, experiment, (arm[1] for arm in started if arm[0] == experiment))
    ]


def _table(flows: Sequence[_Flow]) -> Table:
    columns = (
        Column("kind", "Kind"),
        Column("experiment", "Experiment"),
        Column("started", "Started", "count"),
        Column("finished", "Finished", "count"),
        Column("withdrawn", "Withdrew", "count"),
        Column("silent", "Stopped", "count"),
        Column("dropped", "Dropped out", "count"),
        Column("share", "Share", "percent", 1),
        Column("low", "95 % low", "percent", 1),
        Column("high", "high", "percent", 1),
    )
    rows = tuple(
        (
            *(flow.kind, flow.experiment, flow.started, flow.finished, flow.withdrawn, flow.silent, flow.dropped),
            flow.dropped / flow.started,
            *wilson_interval(flow.dropped, flow.started),
        )
        for flow in flows
        if flow.started
    )
    note = "Trials, not people: everybody starts several. Wilson's intervals."
    return Table("drop_out", "Drop-out by kind", columns, rows, note)


def _tests(flows: Sequence[_Flow], seed: int) -> tuple[dict[str, DropOutTest], list[Block]]:
    tests: dict[str, DropOutTest] = {}
    statements: list[Block] = []
    for experiment in dict.fromkeys(flow.experiment for flow in flows):
        of_it = [flow for flow in flows if flow.experiment == experiment]
        found = compare_drop_out([flow.started for flow in of_it], [flow.dropped for flow in of_it], seed)
        if found is not None:
            tests[experiment] = found
            continue
        dropped, started = sum(flow.dropped for flow in of_it), sum(flow.started for flow in of_it)
        kinds = counted(sum(flow.started > 0 for flow in of_it), "kind")
        statements.append(
            Statement(
                f"The test of drop-out in experiment {experiment}",
                f"there were {counted(dropped, 'drop-out')} in {counted(started, 'trial')} of {kinds}, so nothing can "
                "be compared",
            )
        )
    return tests, statements


def _test_table(tests: dict[str, DropOutTest]) -> Table:
    columns = (
        Column("experiment", "Experiment"),
        Column("statistic", "Chi-square", "number"),
        Column("df", "df", "count"),
        Column("p", "p", "p"),
        Column("method", "Method"),
        Column("standard_error", "Standard error of p", "number", 4),
    )
    rows = tuple(
        (experiment, test.statistic, test.df, test.p_value, test.method.replace("_", "-"), test.standard_error)
        for experiment, test in tests.items()
    )
    note = f"By permutation where fewer than {LEAST_EXPECTED} drop-outs of a kind are expected."
    return Table("drop_out_tests", "Tests of equal drop-out", columns, rows, note)


def _assumptions(flows: Sequence[_Flow], tests: dict[str, DropOutTest]) -> tuple[Assumption, ...]:
    found = []
    for experiment, test in tests.items():
        of_it = [flow for flow in flows if flow.experiment == experiment]
        dropped, started = sum(flow.dropped for flow in of_it), sum(flow.started for flow in of_it)
        least = min(flow.started for flow in of_it if flow.started) * min(dropped, started - dropped) / started
        named = f"Drop-out, experiment {experiment}"
        how = "so the distribution is by permutation" if test.method == "permutation" else "so chi-square holds"
        found += [
            Assumption(
                named,
                "Expected counts are large enough for the distribution that is used.",
                f"The smallest expected count is {least:.1f}, {how}.",
                "holds",
            ),
            Assumption(
                named,
                "People who start a trial are alike, whichever kind it is of.",
                "Kinds were drawn at random and balanced; where some are readier to leave, the test errs on the "
                "cautious side.",
                "by design",
            ),
        ]
    return tuple(found)
