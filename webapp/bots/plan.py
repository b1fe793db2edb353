"""Who does what: everything about each bot that chance decides, drawn from one seed before the first one starts."""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from webapp.bots.behaviours import BEHAVIOURS, Behaviour
from webapp.bots.mix import allot
from webapp.bots.opinions import BETWEEN_SD


@dataclass(frozen=True, slots=True)
class BotPlan:
    """One bot.

    Attributes:
        number: From 1, in the order of the starts.
        behaviour: What it does.
        language: The code of the language that it reads.
        seed: Where its answers come from, together with the number of a page.
        intercept: How far its ratings lie above everybody's, in points; see `opinions`.
        favourite: From 0 to below 1: which value one gives who gives the same everywhere.
        leaves_after: From 0 to below 1: the share of the pages after which one leaves who leaves.
        says_goodbye: Whether one who leaves withdraws the way that the study offers, rather than close the window.
    """

    number: int
    behaviour: Behaviour
    language: str
    seed: str
    intercept: float
    favourite: float
    leaves_after: float
    says_goodbye: bool

    def stream(self, *purpose: object) -> random.Random:
        """Return the randomness for one purpose, which is the same whatever was drawn for others."""
        return _stream(self.seed, *purpose)


def make_plan(shares: Mapping[str, float], num_bots: int, languages: Sequence[str], seed: int) -> tuple[BotPlan, ...]:
    """Plan all bots; the same arguments give the same plan.

    Args:
        shares: By the name of the behaviour, summing to 1.
        num_bots: How many there are.
        languages: Taken in turn.
        seed: Where everything comes from.
    """
    names = [name for name, count in allot(shares, num_bots).items() for _ in range(count)]
    _stream(seed, "order").shuffle(names)
    return tuple(
        _plan_bot(number, name, languages[(number - 1) % len(languages)], f"{seed}/{number}")
        for number, name in enumerate(names, start=1)
    )


def _plan_bot(number: int, name: str, language: str, seed: str) -> BotPlan:
    rng = _stream(seed, "person")
    return BotPlan(
        number=number,
        behaviour=BEHAVIOURS[name],
        language=language,
        seed=seed,
        intercept=rng.gauss(0, BETWEEN_SD),
        favourite=rng.random(),
        leaves_after=rng.random(),
        says_goodbye=rng.random() < 0.5,  # noqa: PLR2004 - heads or tails.
    )


def _stream(*parts: object) -> random.Random:
    return random.Random("/".join(map(str, parts)))  # noqa: S311 - what a bot answers needs no secrecy.
