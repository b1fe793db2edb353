"""Who is where, drop-out, allocation, times and quality, from the tally and the people who may still go on."""

from collections import Counter
from dataclasses import dataclass
from itertools import accumulate, product

from webapp.storage.live_numbers import (
    ArmFlow,
    Cell,
    CellUse,
    Counts,
    DropOutTest,
    FocusCount,
    FunnelStep,
    PageTime,
    RuleCount,
    UnvalidatedLanguage,
)
from webapp.storage.live_plans import Arm, Plans
from webapp.storage.live_tally import Tally, quantile
from webapp.study.attrition import compare_drop_out
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.quality import declared_rules, rule_words
from webapp.study.session import PageKind

_MICROSECONDS = 1_000_000
_PAGE_KINDS: tuple[PageKind, ...] = (
    *("background", "instructions", "practice", "quiz"),
    *("situation", "first_drive", "explanation", "rating", "satisfaction", "probe", "drive"),
)


@dataclass(frozen=True, slots=True)
class Stalled:
    """Those who may still go on but gave no sign of life within the lease.

    Attributes:
        num: How many they are.
        arms: By arm, in how many of its trials they are.
        places: By experiment, arrangement and order, how many of them were given it.
    """

    num: int
    arms: Counter[Arm]
    places: Counter[tuple[str, int, int]]


def stalled(tally: Tally, silent_before: int) -> Stalled:
    """Count who is stalled; `silent_before` is in microseconds since 1970."""
    silent = [person for person in tally.open.values() if person.last_seen < silent_before]
    at_hand = ((person.plan.arms, person.trial_at_hand) for person in silent)
    return Stalled(
        num=len(silent),
        arms=Counter(arms[trial] for arms, trial in at_hand if trial is not None),
        places=Counter(place for person in silent for place in person.places),
    )


def counts(tally: Tally, silent: Stalled) -> Counts:
    """Return how many are where."""
    return Counts(
        arrived=tally.ends.total(),
        in_progress=tally.ends[None] - silent.num,
        stalled=silent.num,
        completed=tally.ends["completed"],
        withdrawn=tally.ends["withdrawn"],
        screened_out=tally.ends["screened_out"],
        excluded=tally.num_excluded,
    )


def funnel(plans: Plans, tally: Tally) -> tuple[FunnelStep, ...]:
    """Return how many made each step."""
    names = plans.steps
    made = [tally.steps[number] for number in range(1, len(names) + 1)]
    reached = list(accumulate(reversed(made)))[::-1]
    before = [None, *reached[:-1]]
    return tuple(
        FunnelStep(name, count, count / previous if previous else None)
        for name, count, previous in zip(names, reached, before, strict=True)
    )


def cells(plans: Plans, tally: Tally) -> tuple[Cell, ...]:
    """Return how often each kind meets each layout."""
    return tuple(Cell(*cell, assigned=tally.assigned[cell], done=tally.done[cell]) for cell in plans.cells)


def arm_flows(plans: Plans, tally: Tally, silent: Stalled) -> tuple[ArmFlow, ...]:
    """Return how many trials of each kind were started, finished and dropped."""
    return tuple(
        ArmFlow(*arm, tally.started[arm], tally.finished[arm], tally.dropped[arm] + silent.arms[arm])
        for arm in plans.arms
    )


def drop_out_tests(plans: Plans, flows: tuple[ArmFlow, ...]) -> tuple[DropOutTest, ...]:
    """Compare the drop-out of kinds within each experiment; the study's seed is that of the permutations."""
    found = []
    for experiment in plans.study.experiments:
        of_it = [flow for flow in flows if flow.experiment == experiment.id]
        started, dropped = [flow.started for flow in of_it], [flow.dropped for flow in of_it]
        test = compare_drop_out(started, dropped, plans.study.seed)
        if test is not None:
            told = (test.statistic, test.df, test.p_value, test.method, test.standard_error)
            found.append(DropOutTest(experiment.id, *told))
    return tuple(found)


def cell_uses(plans: Plans, tally: Tally, silent: Stalled) -> tuple[CellUse, ...]:
    """Return how often each arrangement was given out with each order of layouts."""
    return tuple(
        CellUse(
            *place,
            uses=tally.uses[place],
            counted=tally.held[place],
            completed=tally.completed[place],
            dropped=tally.lost[place] + silent.places[place],
        )
        for experiment in plans.study.experiments
        for place in product(
            (experiment.id,), range(len(arrangements(experiment))), range(len(layout_orders(experiment)))
        )
    )


def page_times(tally: Tally) -> tuple[PageTime, ...]:
    """Return how long each kind of page takes."""
    return tuple(
        PageTime(kind, len(in_order), *(quantile(in_order, share) / _MICROSECONDS for share in (0.5, 0.25, 0.75)))
        for kind in _PAGE_KINDS
        if kind in tally.times and (in_order := tally.times[kind].in_order())
    )


def rule_counts(plans: Plans, tally: Tally, silent: Stalled) -> tuple[RuleCount, ...]:
    """Return how many each declared rule flags; whoever is stalled counts as not having finished."""
    quality = plans.study.quality
    return tuple(
        RuleCount(
            rule=rule,
            words=rule_words(quality, rule),
            num_flagged=tally.flagged[rule] + (silent.num if rule == "incomplete" else 0),
            num_judged=tally.judged[rule] + (silent.num if rule == "incomplete" else 0),
        )
        for rule in declared_rules(quality)
    )


def focus_count(tally: Tally) -> FocusCount:
    """Return how many left the window."""
    return FocusCount(num_left_window=tally.num_left_window, num_people=tally.num_with_pages)


def unvalidated(plans: Plans, tally: Tally) -> tuple[UnvalidatedLanguage, ...]:
    """Return the languages whose rating items nobody validated."""
    study = plans.study
    return tuple(
        UnvalidatedLanguage(language, tally.languages[language])
        for language in study.languages
        if study.validation(language) == "unvalidated"
    )
