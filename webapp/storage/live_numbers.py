"""What the dashboard shows of everybody together, for one version of a study in one mode, at one moment."""

from dataclasses import dataclass
from typing import Literal

from webapp.storage.live_outcomes import DriveSummary, PredictionSummary, RatingSummary
from webapp.storage.records import Head
from webapp.storage.scope import Scope

State = Literal["consented", "in_progress", "stalled", "completed", "withdrawn", "screened_out"]
"""Where somebody is. `consented` until the first page was sent; `stalled`: no sign of life within the lease."""

DropOutMethod = Literal["chi_square", "permutation"]
"""How the test of drop-out got its p-value."""


@dataclass(frozen=True, slots=True)
class Counts:
    """How many participants are where; `arrived` is the sum of the next five.

    Attributes:
        arrived: Gave their consent, whatever happened later.
        in_progress: Have begun or are about to, and showed a sign of life within the lease.
        stalled: Have neither finished nor left, and showed no sign of life within the lease. They may come back.
        completed: Sent the last page.
        withdrawn: Left before the end.
        screened_out: Failed the quiz, which ended the study for them.
        excluded: Were excluded from the results by a researcher, wherever they are; they count in the others too.
    """

    arrived: int
    in_progress: int
    stalled: int
    completed: int
    withdrawn: int
    screened_out: int
    excluded: int


@dataclass(frozen=True, slots=True)
class FunnelStep:
    """How many got so far.

    Attributes:
        name: What they have done, in English, such as "passed the quiz".
        count: How many did it; never more than at the step before.
        of_previous: `count` as a share of the step before; None at the first step and after a step of nobody.
    """

    name: str
    count: int
    of_previous: float | None


@dataclass(frozen=True, slots=True)
class Cell:
    """One kind of explanation on one layout.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        layout: The layout's name.
        assigned: How many participants are to see it, or have seen it.
        done: How many have sent the last page of its trial, whichever that is: a rating, or a drive.
    """

    experiment: str
    kind: str
    layout: str
    assigned: int
    done: int


@dataclass(frozen=True, slots=True)
class ArmFlow:
    """Trials of one kind. A participant has one for each layout that met the kind.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        started: Trials whose first page was reached: the page before it is stored, or it is the study's first.
        finished: Trials whose last page is stored.
        dropped: Trials in which somebody withdrew or stalled. Stalled people may come back, and then no longer count.
    """

    experiment: str
    kind: str
    started: int
    finished: int
    dropped: int

    @property
    def share_dropped(self) -> float | None:
        """The share of started trials that was dropped; None before the first was started."""
        return self.dropped / self.started if self.started else None


@dataclass(frozen=True, slots=True)
class DropOutTest:
    """Whether kinds of an experiment differ in the share of started trials that were dropped.

    Attributes:
        experiment: The experiment's id.
        statistic: Pearson's chi-square over kinds with started trials.
        df: Their number - 1.
        p_value: The chance of a difference as large if the kind made none.
        method: `chi_square`: the tail of that distribution; `permutation`: where an expected count is below 5.
        standard_error: Of a p-value by permutation; None where it is exact.
    """

    experiment: str
    statistic: float
    df: int
    p_value: float
    method: DropOutMethod
    standard_error: float | None


@dataclass(frozen=True, slots=True)
class CellUse:
    """One arrangement with one order of layouts: what allocation balances.

    Attributes:
        experiment: The experiment's id.
        arrangement: An index into `webapp.study.counterbalancing.arrangements`.
        layout_order: An index into `webapp.study.counterbalancing.layout_orders`.
        uses: How many participants were given it.
        counted: How many of them hold their place; the next participant gets what is held least.
        completed: How many of them finished the study.
        dropped: How many of them withdrew, stalled or were screened out.
    """

    experiment: str
    arrangement: int
    layout_order: int
    uses: int
    counted: int
    completed: int
    dropped: int


@dataclass(frozen=True, slots=True)
class PageTime:
    """How long people take for one kind of page: from the page before it, or the consent, to when it was sent.

    Attributes:
        page_kind: What stands on the page.
        n: How many such pages are counted; a person may have several. Pages that took longer than the lease are left
            out: those people were away.
        median_s: In seconds.
        lower_quartile_s: In seconds.
        upper_quartile_s: In seconds.
    """

    page_kind: str
    n: int
    median_s: float
    lower_quartile_s: float
    upper_quartile_s: float


@dataclass(frozen=True, slots=True)
class RuleCount:
    """How many people one declared exclusion rule flags. Flags are shown; only a researcher excludes.

    Attributes:
        rule: The rule's name in the section `[quality]` of the study file.
        words: The rule in English, with its limit.
        num_flagged: How many people it flags.
        num_judged: How many people can be judged by it so far.
    """

    rule: str
    words: str
    num_flagged: int
    num_judged: int


@dataclass(frozen=True, slots=True)
class FocusCount:
    """How many people left the window; that is shown and never a reason to exclude by itself.

    Attributes:
        num_left_window: How many people did so on a page that they sent.
        num_people: How many people sent a page.
    """

    num_left_window: int
    num_people: int


@dataclass(frozen=True, slots=True)
class UnvalidatedLanguage:
    """A language in which the rating items are a translation that nobody has shown to ask the same.

    Attributes:
        language: The language's code.
        num_participants: How many participants read it.
    """

    language: str
    num_participants: int


@dataclass(frozen=True, slots=True)
class Numbers:
    """The dashboard's numbers. Excluded people are left out of ratings, predictions and drives only.

    Kinds stand here by name; masking them is the view's task.

    Attributes:
        head: The end of the log up to which everything is counted.
        scope: Whose data.
        funnel: From the consent to completion.
        counts: How many are where.
        cells: In the order of the study file, those without participants included.
        arms: Drop-out per arm, in the order of the study file.
        drop_out: A test for each experiment where there is something to compare: two kinds that were started, and
            somebody who dropped.
        arrangements: What allocation balances; all of them, those never used included.
        page_times: In the order in which the study has the kinds of pages; none without a counted page.
        quality: One entry for each rule that the study declares, in the order of the study file's section.
        focus: How many left the window.
        ratings: In the order of the study file, the satisfaction scale last; none without ratings.
        predictions: In the order of the study file; none without predictions.
        drives: In the order of the study file; none without a finished drive.
        unvalidated: Languages that nobody validated, in the order of the study file.
        num_elsewhere: How many participants of other studies, versions and modes the database holds.
    """

    head: Head
    scope: Scope
    funnel: tuple[FunnelStep, ...]
    counts: Counts
    cells: tuple[Cell, ...]
    arms: tuple[ArmFlow, ...]
    drop_out: tuple[DropOutTest, ...]
    arrangements: tuple[CellUse, ...]
    page_times: tuple[PageTime, ...]
    quality: tuple[RuleCount, ...]
    focus: FocusCount
    ratings: tuple[RatingSummary, ...]
    predictions: tuple[PredictionSummary, ...]
    drives: tuple[DriveSummary, ...]
    unvalidated: tuple[UnvalidatedLanguage, ...]
    num_elsewhere: int
