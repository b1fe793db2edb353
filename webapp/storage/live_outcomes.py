"""What the dashboard shows of ratings, predictions and drives: estimates, each with its 95 % interval over people."""

from dataclasses import dataclass
from typing import Literal

from webapp.study.experiments import SATISFACTION_ITEMS

ShareMethod = Literal["wilson", "cluster"]
"""How the interval of a share was made.

`wilson`: Wilson's score interval over people, each of whom counts once. `cluster`: people count several times, so the
spread is that between people (the cluster-robust normal interval of a ratio).
"""


@dataclass(frozen=True, slots=True)
class Share:
    """A share of answers, with its interval over people.

    Attributes:
        n: How many answers there are, at least 1.
        num: How many of them count.
        n_people: By how many people they were given.
        share: `num / n`.
        lower: The lower end of the 95 % interval, in [0, 1].
        upper: Its upper end.
        method: How the interval was made. Where people count several times but show no spread at all (all right, all
            wrong), it is Wilson's with people in the place of answers, which is the wider one.
    """

    n: int
    num: int
    n_people: int
    share: float
    lower: float
    upper: float
    method: ShareMethod


@dataclass(frozen=True, slots=True)
class MeanEstimate:
    """A mean with its interval over people.

    Attributes:
        n: How many values there are, at least 1.
        n_people: From how many people.
        mean: The mean over values.
        lower: The lower end of the 95 % interval; None with a single person.
        upper: Its upper end.
    """

    n: int
    n_people: int
    mean: float
    lower: float | None
    upper: float | None


@dataclass(frozen=True, slots=True)
class RatingSummary:
    """How one kind was rated on one item. A person's several ratings of it are averaged first.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        item: The item's id.
        points: The highest answer of its scale; the lowest is 1.
        n_people: How many people rated, at least 1.
        n: How many ratings they gave.
        mean: The mean over participants' means.
        sd: The standard deviation of participants' means, with n - 1; None for a single person.
        lower: The lower end of the 95 % t interval over participants' means; None for a single person. It may leave
            the scale, as t intervals do.
        upper: Its upper end.
    """

    experiment: str
    kind: str
    item: str
    points: int
    n_people: int
    n: int
    mean: float
    sd: float | None
    lower: float | None
    upper: float | None

    @property
    def is_satisfaction(self) -> bool:
        """Whether the item belongs to the Explanation Satisfaction Scale."""
        return self.item in SATISFACTION_ITEMS


@dataclass(frozen=True, slots=True)
class Calibration:
    """Predictions of one confidence.

    Attributes:
        confidence: From 1 to 5.
        n: How many there are.
        num_right: How many of them are what the agent does.
    """

    confidence: int
    n: int
    num_right: int

    @property
    def share_right(self) -> float | None:
        """The share that is right; None where there are none."""
        return self.num_right / self.n if self.n else None


@dataclass(frozen=True, slots=True)
class PredictionSummary:
    """How participants predicted the agent after one kind.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        right: The share of predictions that is what the agent does.
        as_good: The share with which the goal can be reached in as few steps; no smaller.
        mean_confidence: From 1 to 5, over predictions.
        calibration: One entry for each confidence from 1 to 5, those without predictions included.
    """

    experiment: str
    kind: str
    right: Share
    as_good: Share
    mean_confidence: float
    calibration: tuple[Calibration, ...]


@dataclass(frozen=True, slots=True)
class Driven:
    """How drives before or after an explanation went.

    Attributes:
        reached: The share of finished drives, by giving up and by running out of steps too, that reached the goal;
            None where nobody drove.
        extra_steps: How many steps more than needed those that reached it took; None where none did. People who do
            not arrive are missing here, so read it beside `reached`.
    """

    reached: Share | None
    extra_steps: MeanEstimate | None


@dataclass(frozen=True, slots=True)
class DriveSummary:
    """How participants drove with one kind.

    Attributes:
        experiment: The experiment's id.
        kind: The kind of explanation.
        before: The drives before the explanation.
        after: Those after it.
        gain: Over trials with both: 1 where only the drive after reached the goal, -1 where only the one before did,
            else 0; the mean is the share after minus the share before. None where no trial has both.
    """

    experiment: str
    kind: str
    before: Driven
    after: Driven
    gain: MeanEstimate | None
