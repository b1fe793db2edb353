"""What a comparison of selectors is asked and finds, and the object that other programs read."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from webapp.explainer.fidelity import check_alpha
from webapp.explainer.importance import IMPORTANCE_KINDS, ImportanceKind
from webapp.explainer.selectors.highlights import CONTEXT, MIN_GAP
from webapp.explainer.solvers import Trajectory

SOURCES = {
    "subgoals": "Sakai et al. 2021, section 4.2.2",
    "highlights": "Amir & Amir 2018, AAMAS",
    "landmarks": "Hoffmann, Porteous & Sebastia 2004, JAIR 22",
    "landmark facts": "Sreedharan, Srivastava & Kambhampati 2020, ICAPS",
    "bottlenecks": "Simsek & Barto 2008, NIPS",
    "evenly spaced": "Truong & Venkatesh 2007, ACM TOMM 3(1)",
    "random": "Sakai et al. 2021, section 6",
}
"""Where each selector comes from; the paper's own first."""

SELECTORS = tuple(SOURCES)


@dataclass(frozen=True, slots=True)
class ComparisonSettings:
    """What to compare.

    Attributes:
        importance: Which importance the paper's subgoals come from.
        random_steps: r of that importance, at least 0.
        budget: k, at least 1: how many steps each selector chooses. As many as there are subgoals, but at least 1,
            when left out.
        alpha: In [0, 1): the probability of reaching the goal that an explanation must exceed (equation 1).
        seed: Of the random draws, at least 0.
        num_draws: Over how many random draws the mean is taken, at least 2, so that it has a standard error.
        discount: In (0, 1]: of the values that HIGHLIGHTS compares; below 1 where the importance is of rewards.
        min_gap: The least distance between two steps that HIGHLIGHTS chooses, from 1: the interval of Amir & Amir 2018.
        context: How many states are shown before and after each of them, at least 0. They do not count in the budget.

    Raises:
        ValueError: A setting lies outside its range.

    Example:
        >>> from webapp.explainer import ComparisonSettings
        >>> str(ComparisonSettings(random_steps=5)).split("; ")[:2]
        ['return probability after 5 random actions', 'highlights: discount 0.99, 2 apart']
    """

    importance: ImportanceKind = "return_probability"
    random_steps: int = 10
    budget: int | None = None
    alpha: float = 0.5
    seed: int = 0
    num_draws: int = 30
    discount: float = 0.99
    min_gap: int = MIN_GAP
    context: int = CONTEXT

    def __post_init__(self) -> None:
        if self.importance not in IMPORTANCE_KINDS:
            raise ValueError(f"importance must be one of {', '.join(IMPORTANCE_KINDS)}, not {self.importance!r}")
        for name, smallest in {"random_steps": 0, "seed": 0, "num_draws": 2, "min_gap": 1, "context": 0}.items():
            if getattr(self, name) < smallest:
                raise ValueError(f"{name} must be {smallest} or larger, not {getattr(self, name)}")
        if self.budget is not None and self.budget < 1:
            raise ValueError(f"k must be 1 or larger, not {self.budget}")
        if not 0 < self.discount <= 1:
            raise ValueError(f"the discount must lie above 0 and be at most 1, not {self.discount}")
        check_alpha(self.alpha)

    def __str__(self) -> str:
        """Say in one line what is compared."""
        actions = f"{self.random_steps} random action{'' if self.random_steps == 1 else 's'}"
        importance = {
            "return_probability": f"return probability after {actions}",
            "ace": f"average causal effect after {actions}",
            "reward_importance": f"reward importance, discount {self.discount:g}",
        }[self.importance]
        return (
            f"{importance}; highlights: discount {self.discount:g}, {self.min_gap} apart; "
            f"random: mean of {self.num_draws} draws, seed {self.seed}"
        )


@dataclass(frozen=True, slots=True)
class Measure:
    """A number with its standard error, which is None where the number is exact."""

    value: float
    standard_error: float | None = None


@dataclass(frozen=True, slots=True)
class Rating:
    """How one selector does.

    Attributes:
        selector: One of `SELECTORS`.
        steps: The k steps that it chooses, ascending, or None where the measures are means over random draws.
        overlap: How many of them are subgoals of the paper.
        fidelity: The probability of reaching the goal when the policy is followed at those steps' states only.
        drop: How much the policy's own probability falls when just those states act at random.
        seconds: How long it took to choose the k steps, with all that only this selector needs.
        curve: `[T + 1]`: the fidelity of its choice of 0, 1, .. T steps.
        smallest: The smallest budget whose fidelity exceeds alpha, or None (Sakai et al. 2021, equation 1).
        reasons: What the selector knows of each chosen step, in their order; empty where it knows nothing of them.
        own: The steps that it would choose if it had no budget, each with its reason.
        frames: For each chosen step the first and the last state that are shown with it, from 1 to T + 1; only of
            selectors that show a context.
        note: What must be said beside the numbers, such as that one is an estimate; empty if nothing.
        fillers: Those of `steps` that the method does not name and that only fill the budget.
        min_gap: How far apart its steps were kept, less than what was asked for where so many do not fit; None where
            no distance is kept.
    """

    selector: str
    steps: tuple[int, ...] | None
    overlap: Measure
    fidelity: Measure
    drop: Measure
    seconds: float
    curve: tuple[Measure, ...]
    smallest: int | None
    reasons: tuple[str, ...] = ()
    own: Mapping[int, str] = field(default_factory=dict)
    frames: tuple[tuple[int, int], ...] = ()
    note: str = ""
    fillers: tuple[int, ...] = ()
    min_gap: int | None = None


@dataclass(frozen=True, slots=True)
class Comparison:
    """All selectors on one path at one budget.

    Attributes:
        path: The policy's path of T steps.
        subgoals: The paper's, whatever their number.
        budget: k.
        alpha: As in the settings.
        ratings: One per selector, in the order of `SELECTORS`.
        policy_fidelity: The probability that the policy, followed everywhere, reaches the goal in the same time: 1
            where nothing is left to chance.
        settings: What was asked for.
    """

    path: Trajectory
    subgoals: tuple[int, ...]
    budget: int
    alpha: float
    ratings: tuple[Rating, ...]
    policy_fidelity: float
    settings: ComparisonSettings

    @property
    def horizon(self) -> int:
        """Within how many actions the goal must be reached: twice the path's length."""
        return 2 * self.path.num_steps

    @property
    def scale(self) -> float:
        """Where an axis for the fidelities should end: at 1, or at the largest if all lie in the lower half."""
        peak = max(measure.value for rating in self.ratings for measure in rating.curve)
        return peak if 0 < peak <= 1 / 2 else 1.0


def as_json(comparison: Comparison) -> Mapping[str, object]:
    """Return a comparison as the object that other programs read, made of lists, numbers and text only."""
    return {
        "num_steps": comparison.path.num_steps,
        "subgoals": list(comparison.subgoals),
        "k": comparison.budget,
        "alpha": comparison.alpha,
        "horizon": comparison.horizon,
        "policy_fidelity": comparison.policy_fidelity,
        "settings": asdict(comparison.settings),
        "selectors": [_rating_as_json(rating) for rating in comparison.ratings],
    }


def _rating_as_json(rating: Rating) -> Mapping[str, object]:
    return {
        "selector": rating.selector,
        "source": SOURCES[rating.selector],
        "steps": None if rating.steps is None else list(rating.steps),
        "reasons": list(rating.reasons),
        "frames": [list(frame) for frame in rating.frames],
        "own": [{"step": step, "reason": reason} for step, reason in rating.own.items()],
        "overlap": _numbers(rating.overlap),
        "fidelity": _numbers(rating.fidelity),
        "drop": _numbers(rating.drop),
        "seconds": rating.seconds,
        "curve": [_numbers(measure) for measure in rating.curve],
        "smallest_k": rating.smallest,
        "note": rating.note,
        "fillers": list(rating.fillers),
        "min_gap": rating.min_gap,
    }


def _numbers(measure: Measure) -> Mapping[str, object]:
    return {"value": measure.value, "standard_error": measure.standard_error}
