"""The declared exclusion rules: whom they flag, and why.

A flag is shown and exported; it excludes nobody. That somebody left the window is shown beside and is no rule.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Literal, get_args

from webapp.study.sections import Quality

Rule = Literal[
    "min_total_minutes",
    "min_seconds_per_rating_page",
    "straight_lining",
    "failed_attention_checks",
    "failed_quiz",
    "duplicates",
    "incomplete",
]
"""The rules, by the name of their setting in the section `[quality]`, in its order."""

RULES: tuple[Rule, ...] = get_args(Rule)

_SECONDS = 60
_LEAST_TO_COMPARE = 2


@dataclass(frozen=True, slots=True)
class PersonFacts:
    """What the rules look at.

    Attributes:
        total_s: From the consent to the last page; None for whoever did not complete the study.
        rating_page_s: How long each page with ratings took, in seconds, in any order. Pages during which somebody was
            away for longer than the lease are left out.
        num_rating_pages: How many pages with ratings were sent.
        num_items: How many different items were rated.
        ratings: The values that were given, each once.
        num_checks: How many attention checks were answered.
        num_failed_checks: How many of them wrongly.
        failed_quiz: Whether the quiz was left with a wrong answer in the last attempt; None before it was left, and
            where there is none.
        is_duplicate: Whether the recruiter's id or session stands elsewhere in the live data too; None for whoever
            came without a recruiter.
        is_complete: Whether the last page was sent; None for whoever is still under way.
    """

    total_s: float | None = None
    rating_page_s: tuple[float, ...] = ()
    num_rating_pages: int = 0
    num_items: int = 0
    ratings: frozenset[int] = frozenset()
    num_checks: int = 0
    num_failed_checks: int = 0
    failed_quiz: bool | None = None
    is_duplicate: bool | None = None
    is_complete: bool | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.num_failed_checks <= self.num_checks:
            raise ValueError(f"of {self.num_checks} attention checks, {self.num_failed_checks} cannot have failed")
        if self.total_s is not None and not self.is_complete:
            raise ValueError(f"only who completed the study has a total time, and this is {self.total_s} s")


@dataclass(frozen=True, slots=True)
class Flag:
    """One rule that flags somebody.

    Attributes:
        rule: The rule.
        value: What was found: minutes, seconds, failed checks, or for straight-lining the one value; None where the
            rule has nothing to measure.
        limit: What the study file declares; None where there is nothing to set.
    """

    rule: Rule
    value: float | None
    limit: float | None


def declared_rules(quality: Quality) -> tuple[Rule, ...]:
    """Return the rules that a study declares, in the order of the section."""
    return tuple(rule for rule in RULES if getattr(quality, rule) not in (None, False))


def rule_words(quality: Quality, rule: Rule) -> str:
    """Return a declared rule in English, with its limit, as it reads on the dashboard and in the data's documents."""
    return _WORDS[rule].format(getattr(quality, rule))


def judge(quality: Quality, facts: PersonFacts) -> tuple[Flag, ...]:
    """Return the declared rules that flag somebody, in the order of the section."""
    found = (_JUDGES[rule](quality, facts) for rule in declared_rules(quality))
    return tuple(verdict for verdict in found if isinstance(verdict, Flag))


def judged_rules(quality: Quality, facts: PersonFacts) -> tuple[Rule, ...]:
    """Return the declared rules by which somebody can be judged already, whether they flag them or not."""
    return tuple(rule for rule in declared_rules(quality) if _JUDGES[rule](quality, facts) is not None)


_WORDS: Mapping[Rule, str] = {
    "min_total_minutes": "finished the study in less than {:g} min",
    "min_seconds_per_rating_page": "took less than {:g} s for a page of ratings, as the median over these pages",
    "straight_lining": "gave every item of every trial the same rating",
    "failed_attention_checks": "failed attention checks: {} or more",
    "failed_quiz": "used up all attempts at the quiz without a right one",
    "duplicates": "the same recruiter id or session stands elsewhere in the live data",
    "incomplete": "did not finish the study",
}

_Verdict = Flag | Literal["passed"] | None
"""What a rule says of somebody; None where it cannot say anything yet."""


def _flag_if(rule: Rule, *, is_flagged: bool | None) -> _Verdict:
    if is_flagged is None:
        return None
    return Flag(rule, None, None) if is_flagged else "passed"


def _total(quality: Quality, facts: PersonFacts) -> _Verdict:
    limit = quality.min_total_minutes
    if limit is None or facts.total_s is None:
        return None
    minutes = facts.total_s / _SECONDS
    return Flag("min_total_minutes", minutes, limit) if minutes < limit else "passed"


def _per_rating_page(quality: Quality, facts: PersonFacts) -> _Verdict:
    limit = quality.min_seconds_per_rating_page
    if limit is None or not facts.rating_page_s:
        return None
    seconds = median(facts.rating_page_s)
    return Flag("min_seconds_per_rating_page", seconds, limit) if seconds < limit else "passed"


def _straight_lining(_quality: Quality, facts: PersonFacts) -> _Verdict:
    if min(facts.num_rating_pages, facts.num_items) < _LEAST_TO_COMPARE:
        return None
    return Flag("straight_lining", min(facts.ratings), None) if len(facts.ratings) == 1 else "passed"


def _failed_checks(quality: Quality, facts: PersonFacts) -> _Verdict:
    limit = quality.failed_attention_checks
    if limit is None or not facts.num_checks:
        return None
    failed = facts.num_failed_checks
    return Flag("failed_attention_checks", failed, limit) if failed >= limit else "passed"


def _failed_quiz(_quality: Quality, facts: PersonFacts) -> _Verdict:
    return _flag_if("failed_quiz", is_flagged=facts.failed_quiz)


def _duplicates(_quality: Quality, facts: PersonFacts) -> _Verdict:
    return _flag_if("duplicates", is_flagged=facts.is_duplicate)


def _incomplete(_quality: Quality, facts: PersonFacts) -> _Verdict:
    return _flag_if("incomplete", is_flagged=None if facts.is_complete is None else not facts.is_complete)


_JUDGES: Mapping[Rule, Callable[[Quality, PersonFacts], _Verdict]] = {
    "min_total_minutes": _total,
    "min_seconds_per_rating_page": _per_rating_page,
    "straight_lining": _straight_lining,
    "failed_attention_checks": _failed_checks,
    "failed_quiz": _failed_quiz,
    "duplicates": _duplicates,
    "incomplete": _incomplete,
}
