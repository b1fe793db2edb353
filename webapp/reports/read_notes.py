"""What whoever reads a report should know of how its data were chosen, as sentences."""

from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from webapp.reports.read_corrections import Correction
from webapp.reports.read_exclusions import Decided
from webapp.study.protocol import Study
from webapp.study.quality import declared_rules

_MOST_NAMED = 10


def notes_of(
    tables: Mapping[str, pd.DataFrame],
    declared: Study | None,
    decided: Decided,
    rules: Sequence[str],
    corrections: Sequence[Correction],
    *,
    include_incomplete: bool,
) -> Iterator[str]:
    """Yield the notes.

    Args:
        tables: The tables of the version and mode.
        declared: The study file, None if it is not there.
        decided: Who is analysed.
        rules: The rules that were applied.
        corrections: The corrections.
        include_incomplete: Whether those are analysed too who did not complete the study.
    """
    if "participants" not in tables:
        whoever = "Everybody" if include_incomplete else "Everybody who rated as many trials as anybody"
        yield f"There is no participants.csv. {whoever} is analysed; who left is not known."
    yield from _of_rules(tables, declared, rules)
    yield from _of_exclusions(tables)
    for correction in corrections:
        if correction.problem is not None:
            what = f"{correction.file}, {correction.question!r} of participant {correction.participant}"
            yield f"A correction was not made ({what}, to {correction.after!r}): {correction.problem}."
    if rules and any(correction.file == "ratings" and correction.problem is None for correction in corrections):
        yield "Exclusion rules were judged on what was answered, before corrections."
    if include_incomplete:
        yield "Those who did not complete the study are analysed too, with what they answered."
    silent = sorted(set(decided.analysed) - set(tables["ratings"]["participant"]))
    if silent:
        yield f"Analysed without a single rating: {_named(silent)}."
    if decided.analysed.empty:
        yield "Nobody is left to be analysed."


def _of_rules(tables: Mapping[str, pd.DataFrame], declared: Study | None, rules: Sequence[str]) -> Iterator[str]:
    quality = tables.get("quality")
    judged = set() if quality is None else set(quality["rule"])
    wanted = () if declared is None else declared_rules(declared.quality)
    silent = [rule for rule in wanted if rule not in judged]
    if silent:
        where = "There is no quality.csv" if quality is None else "quality.csv judges nobody by them"
        yield f"Declared exclusion rules that cannot be applied: {', '.join(silent)}. {where}."
    skipped = sorted(judged - set(rules))
    if skipped:
        yield f"Exclusion rules that were not applied, as it was asked for: {', '.join(skipped)}."


def _of_exclusions(tables: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    """Yield which researchers' exclusions came when the answers could be known, or were taken back."""
    people = tables.get("participants")
    if people is not None:
        last = people["completed_at"].max()
        late = people[people["excluded_at"] > last]["participant"]
        if not late.empty:
            when = "after the last participant had finished, when all answers could be seen"
            yield f"Excluded by a researcher {when}: {_named(list(late))}."
    decisions = tables.get("decisions")
    if decisions is not None:
        taken_back = decisions.loc[decisions["action"] == "included", "participant"].drop_duplicates()
        if not taken_back.empty:
            yield f"An exclusion was taken back by a researcher: {_named(list(taken_back))}."


def _named(people: Sequence[str]) -> str:
    named = ", ".join(people[:_MOST_NAMED])
    return named if len(people) <= _MOST_NAMED else f"{named} and {len(people) - _MOST_NAMED} more"
