"""What was declared of the studies in a data set: their files, their plans in words, the wording of their items."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from webapp.reports.read_folder import DataFolder
from webapp.reports.read_problems import DataSetError
from webapp.reports.read_text import decode
from webapp.storage.declared_files import STUDIES
from webapp.study.experiments import SATISFACTION_ITEMS, Item
from webapp.study.problems import StudyError
from webapp.study.protocol import Study, parse_study

DEFAULT_POINTS = 5
"""The points of an item's scale where nothing declares them and no rating is larger."""

_FEWEST_POINTS, MOST_POINTS = 2, 11
"""Of any scale that a study file can declare."""

_FILE = "study.toml"


@dataclass(frozen=True, slots=True)
class Declaration:
    """A study as it was declared before there were data.

    Attributes:
        study: The study.
        version: How the versions begin that it is of; empty for any.
        plan: The registered plan in words, None if there is none.
        file: Where it stands.
    """

    study: Study
    version: str
    plan: str | None
    file: str

    def is_of(self, study: str, version: str) -> bool:
        """Tell whether data of a study and version, empty if they do not say, were declared here."""
        return self.study.name == (study or self.study.name) and version.startswith(self.version)


@dataclass(frozen=True, slots=True)
class Described:
    """What the description of a data set says of the ratings.

    Attributes:
        wordings: The wording of each item.
        points: The points of the longest scale, None if it does not say.
    """

    wordings: Mapping[str, str] = field(default_factory=dict)
    points: int | None = None


def read_declarations(folder: DataFolder) -> tuple[Declaration, ...]:
    """Read every study file of a data set; also one that lies beside the data.

    Raises:
        DataSetError: A file cannot be used.
    """
    places = [(f"{STUDIES}/{name}/", name.rpartition("-")[2]) for name in folder.folders(STUDIES)]
    return tuple(
        found for prefix, version in (*places, ("", "")) if (found := _declaration(folder, prefix, version)) is not None
    )


def points_of(
    declaration: Declaration | None, experiment: str, item: str, described: Described, largest: int
) -> int | None:
    """Return how many points an item's scale has.

    Args:
        declaration: The study file, None if there is none.
        experiment: The experiment.
        item: The item.
        described: What the data set says of the ratings.
        largest: The largest rating of the item, which tells its points where nothing else does.

    Returns:
        The points; None if the study is declared and does not ask the item there.
    """
    if declaration is None:
        return described.points or min(max(DEFAULT_POINTS, largest), MOST_POINTS)
    asked = {each.id: each for each in declaration.study.experiments}.get(experiment)
    if asked is None:
        return None
    own = SATISFACTION_ITEMS if asked.satisfaction else ()
    points = {each.id: each.points for each in (*asked.items, *(Item(id=name) for name in own))}
    return points.get(item)


def kinds_of(declaration: Declaration | None, experiment: str) -> tuple[str, ...] | None:
    """Return the kinds of an experiment; None where nothing is declared of it."""
    declared = () if declaration is None else declaration.study.experiments
    return next((each.kinds for each in declared if each.id == experiment), None)


def read_description(folder: DataFolder) -> Described:
    """Read what the description of a data set says of the ratings; nothing where there is none."""
    content = folder.read("dataset_description.json")
    if content is None:
        return Described()
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        folder.notes.append("dataset_description.json cannot be read, so the wording of the items is not known.")
        return Described()
    variables = {variable["name"]: variable for variable in _variables(tree)}
    most = variables.get("rating", {}).get("maxValue")
    is_bound = isinstance(most, int) and _FEWEST_POINTS <= most <= MOST_POINTS
    return Described(dict(_levels(variables.get("item", {}))), most if is_bound else None)


def _declaration(folder: DataFolder, prefix: str, version: str) -> Declaration | None:
    content = folder.read(f"{prefix}{_FILE}") if prefix or (folder.root / _FILE).exists() else None
    if content is None:
        return None
    file = f"{prefix}{_FILE}"
    try:
        study = parse_study(decode(file, content), file)
    except StudyError as error:
        raise DataSetError(error.problems) from None
    except RecursionError:
        raise DataSetError([f"{file}: is nested too deeply to be a study file"]) from None
    name = None if study.analysis is None else study.analysis.plan
    plan = None if name is None else folder.read(f"{prefix}{name}")
    return Declaration(study, version, None if plan is None else decode(f"{prefix}{name}", plan), file)


def _variables(tree: object) -> Iterator[dict[str, Any]]:
    found = tree.get("variableMeasured") if isinstance(tree, dict) else None
    for variable in found if isinstance(found, list) else ():
        if isinstance(variable, dict) and isinstance(variable.get("name"), str):
            yield variable


def _levels(variable: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    found = variable.get("valueReference")
    for level in found if isinstance(found, list) else ():
        code, name = (level.get(key) for key in ("termCode", "name")) if isinstance(level, dict) else (None, None)
        if isinstance(code, str) and isinstance(name, str):
            yield code, name
