"""Whether the planned comparisons depend on who is analysed: the same tests on other choices of people and values."""

from collections.abc import Iterator, Sequence

from webapp.analysis.planned_comparisons import Comparison, compare_kinds
from webapp.reports.blocks import Block, Cell, Column, Section, Table
from webapp.reports.sections.ordinal import conclusion
from webapp.reports.study_data import StudyData

Variant = tuple[str, StudyData]
"""What was chosen otherwise, in words, and the data that this gives."""

_INTRODUCTION = (
    "The same models on other choices of people and values. These tests confirm nothing by themselves; they say "
    "whether a conclusion hangs on an exclusion or a correction."
)


def section(data: StudyData, variants: Sequence[Variant]) -> Section:
    """Make the planned comparisons again on other choices.

    Args:
        data: As they are analysed in the report.
        variants: The other choices.
    """
    planned = {_key(test): test for test in compare_kinds(data.ratings, data.plan).tests}
    rows: list[tuple[Cell, ...]] = [_row("as planned", data, test, test) for test in planned.values()]
    blocks: list[Block] = [_INTRODUCTION]
    changes: list[str] = []
    same: list[str] = []
    for words, other in variants:
        if _same_people(data, other):
            same.append(words)
            continue
        tests = compare_kinds(other.ratings, data.plan).tests
        rows += [_row(words, other, test, planned[_key(test)]) for test in tests]
        changes += list(_changes(words, tests, planned))
    blocks += [_summary(changes, len(variants) - len(same)), *_told_same(same)]
    if len(same) < len(variants):
        blocks.append(Table("sensitivity", "The planned comparisons on other choices", _COLUMNS, tuple(rows)))
    return Section("sensitivity", "Sensitivity to who is analysed", tuple(blocks))


_COLUMNS = (
    Column("choice", "Choice"),
    Column("people", "People", "count"),
    Column("experiment", "Experiment"),
    Column("item", "Item"),
    Column("contrast", "Contrast"),
    Column("d", "d", "number"),
    Column("d_low", "95 % from", "number"),
    Column("d_high", "to", "number"),
    Column("p_holm", "p (Holm)", "p"),
    Column("conclusion", "Conclusion"),
    Column("changed", "Other than planned"),
)


def _key(test: Comparison) -> tuple[str, str, str]:
    return test.contrast.experiment, test.item, str(test.contrast)


def _row(words: str, data: StudyData, test: Comparison, planned: Comparison) -> tuple[Cell, ...]:
    effect = test.effect
    numbers: tuple[Cell, ...] = (None, None, None) if effect is None else (effect.d, effect.d_low, effect.d_high)
    changed = "changed" if conclusion(test) != conclusion(planned) else None
    people = int(data.ratings["participant"].nunique())
    return (words, people, *_key(test), *numbers, test.p_holm, conclusion(test), changed)


def _changes(words: str, tests: Sequence[Comparison], planned: dict[tuple[str, str, str], Comparison]) -> Iterator[str]:
    for test in tests:
        before, after = conclusion(planned[_key(test)]), conclusion(test)
        if before != after:
            experiment, item, contrast = _key(test)
            yield f"{words}, experiment {experiment}, {item}, {contrast}: {after} instead of {before}"


def _summary(changes: Sequence[str], num_variants: int) -> str:
    if not num_variants:
        return "No other choice gives other data: nobody was left out and nothing was corrected."
    if not changes:
        return "No conclusion changes."
    return f"Conclusions that change: {'; '.join(changes)}."


def _told_same(same: Sequence[str]) -> list[str]:
    return [f"These choices lead to exactly the data that are analysed: {'; '.join(same)}."] if same else []


def _same_people(data: StudyData, other: StudyData) -> bool:
    columns = ["participant", "experiment", "trial", "item", "rating"]
    return bool(data.ratings[columns].reset_index(drop=True).equals(other.ratings[columns].reset_index(drop=True)))
