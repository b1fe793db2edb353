"""What a data set says about itself: the file `dataset_description.json` of Psych-DS, which is schema.org's JSON-LD."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from webapp.stimuli.catalogue import Catalogue
from webapp.storage.scope import Scope
from webapp.storage.variables import Type, Variable

_TYPES: Mapping[Type, str] = {
    "text": "https://schema.org/Text",
    "integer": "https://schema.org/Integer",
    "number": "https://schema.org/Number",
    "boolean": "https://schema.org/Boolean",
    "time": "https://schema.org/DateTime",
}


@dataclass(frozen=True, slots=True)
class Covered:
    """What a data set covers.

    Attributes:
        participants: How many participants there are of each version of a study in each mode.
        begun_at: When the first of them agreed; None if there is none.
        ended_at: When the last sign of life came.
        languages: The codes of the languages that they read.
    """

    participants: Mapping[Scope, int]
    begun_at: datetime | None
    ended_at: datetime | None
    languages: Sequence[str]

    @property
    def studies(self) -> tuple[str, ...]:
        """The names of the studies, each once."""
        return tuple(dict.fromkeys(scope.study for scope in self.participants))


def describe(
    covered: Covered, columns: Mapping[str, Sequence[Variable]], bundles: Sequence[Catalogue], now: datetime
) -> dict[str, Any]:
    """Describe a data set.

    Args:
        covered: What it covers.
        columns: The columns of each file.
        bundles: Those of its versions' bundles that are still there: they have the wording of the items.
        now: When the data set is made.
    """
    studies = " and ".join(covered.studies) or "no study"
    total = sum(covered.participants.values())
    parts = "; ".join(
        f"{scope.study}, version {scope.study_version}, mode {scope.mode}: {count} participants"
        for scope, count in covered.participants.items()
    )
    description = {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": f"Data of {studies}",
        "description": (
            f"How people understood explanations of what a learned agent does; {total} participants. "
            f"Rows with mode live are the data, those with mode test or bot are trials. {parts}".strip()
        ),
        "dateCreated": _day(now),
        "inLanguage": list(covered.languages),
        "keywords": ["explainable reinforcement learning", "user study", *covered.studies],
        "identifier": list(dict.fromkeys(scope.study_version for scope in covered.participants)),
        "variableMeasured": variables_measured(columns, bundles),
    }
    if covered.begun_at is not None and covered.ended_at is not None:
        description["temporalCoverage"] = f"{_day(covered.begun_at)}/{_day(covered.ended_at)}"
    return description


def variables_measured(columns: Mapping[str, Sequence[Variable]], bundles: Sequence[Catalogue]) -> list[dict[str, Any]]:
    """Describe the columns of some files, each name once; where a name means several things it says which is where."""
    found: dict[str, list[tuple[Variable, list[str]]]] = {}
    for file, variables in columns.items():
        for variable in variables:
            meanings = found.setdefault(variable.name, [])
            same = next((files for meaning, files in meanings if meaning == variable), None)
            if same is None:
                meanings.append((variable, [file]))
            else:
                same.append(file)
    return [_property(_worded(_merged(meanings), bundles)) for meanings in found.values()]


def _merged(meanings: Sequence[tuple[Variable, Sequence[str]]]) -> Variable:
    (first, _), *others = meanings
    if not others:
        return first
    told = " ".join(f"In {', '.join(files)}: {variable.description}" for variable, files in meanings)
    return Variable(
        first.name,
        first.type if all(other.type == first.type for other, _ in others) else "text",
        told,
        unit=first.unit if all(other.unit == first.unit for other, _ in others) else None,
    )


def _worded(variable: Variable, bundles: Sequence[Catalogue]) -> Variable:
    """Add the wording of items and of the ends of their scales, as the studies have them in their first language."""
    if variable.name == "item":
        return replace(variable, levels={item: legend for item, legend, _, _ in _items(bundles)})
    item_id = "" if variable.name == "rating" else variable.name.partition(".rating.")[2]
    if variable.name != "rating" and not item_id:
        return variable
    worded = [item for item in _items(bundles) if not item_id or item[0] == item_id]
    if not worded:
        return variable
    ends = " ".join(f"{'' if item_id else f'{item}: '}{ends}" for item, _, _, ends in worded)
    legends = "".join(f" “{legend}”" for _, legend, _, _ in worded) if item_id else ""
    return replace(
        variable,
        description=f"{variable.description}{legends} {ends}",
        maximum=max(points for _, _, points, _ in worded),
    )


def _items(bundles: Sequence[Catalogue]) -> Iterator[tuple[str, str, int, str]]:
    """Yield item, wording, points and what the ends of the scale mean, each item once."""
    seen: set[str] = set()
    for bundle in bundles:
        texts = bundle.texts(bundle.study.languages[0])
        for experiment in bundle.study.experiments:
            for item in experiment.items:
                if item.id not in seen:
                    seen.add(item.id)
                    words = texts.item(item.id, experiment.id)
                    yield item.id, words.legend, item.points, f"1 = {words.low}, {item.points} = {words.high}."


def _property(variable: Variable) -> dict[str, Any]:
    described: dict[str, Any] = {
        "@type": "PropertyValue",
        "name": variable.name,
        "description": variable.description,
        "additionalType": _TYPES[variable.type],
    }
    if variable.unit is not None:
        described["unitText"] = variable.unit
    if variable.minimum is not None:
        described["minValue"] = variable.minimum
    if variable.maximum is not None:
        described["maxValue"] = variable.maximum
    if variable.levels:
        described["valueReference"] = [
            {"@type": "DefinedTerm", "termCode": level, "name": meaning} for level, meaning in variable.levels.items()
        ]
    return described


def _day(time: datetime) -> str:
    return time.astimezone(UTC).date().isoformat()
