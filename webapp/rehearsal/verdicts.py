"""Whether the planned analysis found what was planted, and nothing that was not: a verdict for each planned test."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from webapp.analysis.planned_comparisons import Comparison, Comparisons
from webapp.bots.effects import Effects
from webapp.rehearsal.planting import planted_difference
from webapp.study.analysis_plan import Contrast

Word = Literal["recovered", "missed", "off", "quiet", "false alarm", "not determined"]
"""Something planted is recovered if it is found, with the right sign, and its simultaneous interval holds what was
planted; missed if it is not found; off if it is found and the sign or the interval is wrong. Nothing planted: quiet, or
found all the same.
"""

GOOD: frozenset[Word] = frozenset({"recovered", "quiet"})


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of one planned test.

    Attributes:
        contrast: The kinds that are compared.
        item: The item.
        planted: The true d.
        d: The estimate; None where the ratings do not determine it, as for the next three.
        low: The lower end of its simultaneous interval: all tests' intervals together hold what was planted with a
            chance of 1 - alpha or more (Bonferroni).
        high: Its upper end.
        p_holm: Corrected for all planned tests.
        word: The verdict.
    """

    contrast: Contrast
    item: str
    planted: float
    d: float | None
    low: float | None
    high: float | None
    p_holm: float | None
    word: Word

    @property
    def is_good(self) -> bool:
        """Whether the analysis told the truth."""
        return self.word in GOOD


def judge(found: Comparisons, effects: Effects) -> tuple[Verdict, ...]:
    """Return a verdict for each planned test, in the order of the plan."""
    return tuple(
        _verdict(test, planted_difference(effects, test.contrast, test.item), len(found.tests)) for test in found.tests
    )


def conclusion(verdicts: Sequence[Verdict]) -> str:
    """Say in a sentence or two what the verdicts come to."""
    bad = [verdict for verdict in verdicts if not verdict.is_good]
    if not bad:
        return "The analysis recovered everything that was planted and found nothing else."
    words = ", ".join(f"{verdict.contrast} on {verdict.item} ({verdict.word})" for verdict in bad)
    return (
        f"{len(bad)} of {len(verdicts)} tests did not come out as planted: {words}. An honest rehearsal errs in about "
        "one of twenty runs, and misses effects that are small for its number of participants (see `xar power`). "
        "Run it again with another --seed before you suspect the study."
    )


def _verdict(test: Comparison, planted: float, num_tests: int) -> Verdict:
    if test.effect is None:
        return Verdict(test.contrast, test.item, planted, None, None, None, None, "not determined")
    low, high = test.effect.interval(1 - test.alpha / num_tests)
    word = _word(planted, test.effect.d, (low, high), is_found=test.is_found)
    return Verdict(test.contrast, test.item, planted, test.effect.d, low, high, test.p_holm, word)


def _word(planted: float, d: float, interval: tuple[float, float], *, is_found: bool) -> Word:
    if planted == 0:
        return "false alarm" if is_found else "quiet"
    if not is_found:
        return "missed"
    return "recovered" if d * planted > 0 and interval[0] <= planted <= interval[1] else "off"
