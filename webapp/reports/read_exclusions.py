"""Who is analysed. What decides it never sees which explanation anybody was shown."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

INCOMPLETE = "incomplete"
BY_RESEARCHER = "excluded by a researcher"
BEFORE_RATING = "left before the first rating"
WITHOUT_ANSWERS = "answered nothing"

_UNBLINDING = frozenset({"kind", "draw", "assignment", "arrangement", "rating"})
"""Columns from which a kind, or what it did, could be told."""


@dataclass(frozen=True, slots=True)
class Decided:
    """Who is analysed, and why the others are not.

    Attributes:
        reasons: By participant, in the order in which they came: why not, missing for whoever is analysed. Whoever did
            not complete the study, or answered nothing, has no other reason than that; of several rules the first one
            counts, and a rule before a researcher.
        flagged: By rule: how many it flags, whoever did not complete included.
    """

    reasons: pd.Series
    flagged: dict[str, int]

    @property
    def analysed(self) -> pd.Index:
        """The participants who are analysed."""
        return self.reasons.index[self.reasons.isna()]


def decide(
    people: pd.DataFrame,
    flags: pd.DataFrame,
    rules: Sequence[str],
    *,
    apply_exclusions: bool = True,
    include_incomplete: bool = False,
) -> Decided:
    """Decide who is analysed.

    Args:
        people: One row per person: `participant`, `is_complete`, `is_excluded` (by a researcher), `has_rated` (anything
            at all) and `has_answered` (rated, predicted or driven).
        flags: Which rule speaks against whom: `participant`, `rule`.
        rules: The rules to apply, in their order.
        apply_exclusions: Whether researchers' exclusions count.
        include_incomplete: Whether those are analysed too who did not complete the study, if they rated anything; that
            they did not complete it is then no rule either.

    Raises:
        ValueError: A table holds what the decision must not know.
    """
    for table in (people, flags):
        if _UNBLINDING & set(table.columns):
            raise ValueError(f"exclusions are decided without {', '.join(sorted(_UNBLINDING & set(table.columns)))}")
    reasons = pd.Series(None, index=pd.Index(people["participant"], dtype="str"), dtype="str")
    applied = [rule for rule in rules if not (include_incomplete and rule == INCOMPLETE)]
    if apply_exclusions:
        reasons[people["is_excluded"].to_numpy()] = BY_RESEARCHER
    for rule in reversed(applied):
        against = flags.loc[flags["rule"] == rule, "participant"]
        reasons[reasons.index.isin(against)] = rule
    is_complete = people["is_complete"].to_numpy()
    reasons[is_complete & ~people["has_answered"].to_numpy()] = WITHOUT_ANSWERS
    if include_incomplete:
        reasons[~is_complete & ~people["has_rated"].to_numpy()] = BEFORE_RATING
    else:
        reasons[~is_complete] = INCOMPLETE
    flagged = {rule: int(flags.loc[flags["rule"] == rule, "participant"].nunique()) for rule in rules}
    return Decided(reasons, flagged)
