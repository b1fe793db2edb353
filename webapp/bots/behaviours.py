"""How bots behave: one line of a table for each behaviour."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

RatingStyle = Literal["opinion", "same", "random", "high"]
"""Where ratings come from: see `opinions`; one value everywhere; any value; one of the two highest."""


@dataclass(frozen=True, slots=True)
class Behaviour:
    """One way of taking part. Probabilities are per question or per drive, before any declared effect.

    Attributes:
        name: As `--mix` names it.
        words: What such a bot does.
        rates: Where its ratings come from.
        follows_effects: Whether the declared effects hold for it.
        knows_quiz: The probability of knowing an answer of the quiz; who does not guesses.
        attends: The probability of choosing what an attention check says; who does not rates it like the other items.
        predicts: The probability of predicting the agent's action; None for a guess among all actions.
        arrives: The probability that a drive ends at the goal; the others give up on the way.
        skill: The probability, at each step of a drive that arrives, of a best action; the others are detours.
        pace: The factor on all response times.
        leaves: Whether it leaves on some page, by closing the window or by the way that the study offers.
        sends_twice: Whether it sends every form twice at the same time, over two connections.
        refreshes: Whether it loads every page again, and sends old forms again, with other answers.
    """

    name: str
    words: str
    rates: RatingStyle = "opinion"
    follows_effects: bool = True
    knows_quiz: float = 1.0
    attends: float = 1.0
    predicts: float | None = 0.6
    arrives: float = 0.7
    skill: float = 0.9
    pace: float = 1.0
    leaves: bool = False
    sends_twice: bool = False
    refreshes: bool = False


def _careless(name: str, words: str, rates: RatingStyle, pace: float = 1.0) -> Behaviour:
    """Return a behaviour that reads nothing: it guesses, finds the goal rarely, and follows no effect."""
    return Behaviour(
        name,
        words,
        rates=rates,
        follows_effects=False,
        knows_quiz=0.3,
        attends=0.0,
        predicts=None,
        arrives=0.3,
        skill=0.4,
        pace=pace,
    )


BEHAVIOURS: Mapping[str, Behaviour] = {
    behaviour.name: behaviour
    for behaviour in (
        Behaviour("attentive", "reads everything; its answers follow the declared effects"),
        _careless("straight-liner", "gives the same value everywhere", "same", pace=0.5),
        _careless("random", "gives any answer", "random"),
        _careless("acquiescent", "agrees with everything: only the highest values", "high"),
        _careless("fast", "gives any answer, in a twentieth of the time", "random", pace=0.05),
        Behaviour("drop-out", "like attentive, but leaves on some page", leaves=True),
        Behaviour("double-clicker", "like attentive, but sends every form twice at the same time", sends_twice=True),
        Behaviour("refresher", "like attentive, but loads pages again and sends old forms again", refreshes=True),
    )
}
