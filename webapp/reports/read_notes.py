"""What whoever reads a report should know of how its data were chosen, as sentences."""

from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from webapp.reports.formatting import counted
from webapp.reports.read_corrections import Correction
from webapp.reports.read_exclusions import BY_RESEARCHER, Decided
from webapp.reports.read_folder import DataFiles
from webapp.study.protocol import Study
from webapp.study.quality import declared_rules

_MOST_NAMED = 10


def notes_of(
    tables: Mapping[str, pd.DataFrame],
    declared: Study | None,
    decided: Decided,
    rules: Sequence[str],
    corrections: Sequence[Correction],
    files: DataFiles,
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
        files: What the files are called.
        include_incomplete: Whether those are analysed too who did not complete the study.
    """
    if "participants" not in tables:
        whoever = "Everybody" if include_incomplete else "Everybody who rated as many trials as anybody"
        yield f"There is no {files.name_of('participants')}. {whoever} is analysed; who left is not known."
    yield from _of_rules(tables, declared, rules, files)
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


def differences_of(
    tables: Mapping[str, pd.DataFrame],
    declared: Study | None,
    decided: Decided,
    corrections: Sequence[Correction],
    files: DataFiles,
) -> Iterator[str]:
    """Yield what differs from data as they were exported and from exclusions by declared rules alone, as sentences."""
    if not files.has_manifest:
        yield "The data set has no manifest, so nothing shows that its files are those of the export."
    for names, what in (
        (files.missing, "are in the manifest and not there"),
        (files.changed, "are not as they were exported"),
        (files.added, "were added after the export"),
    ):
        if names:
            yield f"Files that {what}: {', '.join(names)}."
    silent = _silent_rules(tables, declared)
    if silent:
        yield f"Declared exclusion rules could not be applied: {', '.join(silent)}."
    by_researcher = int((decided.reasons == BY_RESEARCHER).sum())
    if by_researcher:
        yield f"Outside of the declared rules, researchers excluded {counted(by_researcher, 'participant')}."
    corrected = sum(correction.problem is None for correction in corrections)
    if corrected:
        yield f"Researchers corrected {counted(corrected, 'value')}, each with a reason."


def _silent_rules(tables: Mapping[str, pd.DataFrame], declared: Study | None) -> list[str]:
    """Return the declared rules by which nobody was judged."""
    quality = tables.get("quality")
    judged = set() if quality is None else set(quality["rule"])
    return [rule for rule in (() if declared is None else declared_rules(declared.quality)) if rule not in judged]


def _of_rules(
    tables: Mapping[str, pd.DataFrame], declared: Study | None, rules: Sequence[str], files: DataFiles
) -> Iterator[str]:
    quality, name = tables.get("quality"), files.name_of("quality")
    silent = _silent_rules(tables, declared)
    if silent:
        where = f"There is no {name}" if quality is None else f"{name} judges nobody by them"
        yield f"Declared exclusion rules that cannot be applied: {', '.join(silent)}. {where}."
    judged = set() if quality is None else set(quality["rule"])
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
