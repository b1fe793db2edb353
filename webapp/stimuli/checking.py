"""A study, checked as far as that goes without anybody taking part: its files, its arms, its length, its rules."""

import json
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import Any, Literal

from webapp.explainer.worlds.key_door import tabulate
from webapp.explainer.worlds.layout import LayoutError, parse_layout
from webapp.stimuli.agents import AgentProvider, planner_agents
from webapp.stimuli.arm_linter import ArmReport, compare_arms
from webapp.stimuli.build import build, find_built
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.duration import Duration, expected_duration, full_round
from webapp.stimuli.frozen_files import check_plan
from webapp.stimuli.learned import learned_agents, setting_problems
from webapp.stimuli.publication import MANIFEST
from webapp.stimuli.sources import read_sources
from webapp.study.analysis_plan import plan_of
from webapp.study.problems import StudyError, located, read_toml
from webapp.study.protocol import Study, parse_study
from webapp.study.required_sample import RequiredSamples, design_digest, read_required
from webapp.study.sections import Quality
from webapp.study.texts import parse_texts


@dataclass(frozen=True, slots=True)
class Check:
    """What there is to know about a study before launch.

    Attributes:
        study: The study.
        agents: Whose explanations were compared: the built bundle's `learned` agents, or `planner` ones that know the
            world exactly, because the study was not built since its files changed.
        arms: Per experiment.
        duration: How long participants need.
        full_round: How many participants use every arrangement equally often.
        required: How many the planned analysis needs; None if that was not computed for this design and plan.
        notes: What to think about, in words; nothing of it keeps the study from running as a test.
    """

    study: Study
    agents: Literal["learned", "planner"]
    arms: tuple[ArmReport, ...]
    duration: Duration
    full_round: int
    required: RequiredSamples | None
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "study": self.study.name,
            "agents": self.agents,
            "arms": [
                {**asdict(report), "warnings": [str(confound) for confound in report.confounds]} for report in self.arms
            ],
            "minutes": asdict(self.duration),
            "full_round": self.full_round,
            "required_participants": None if self.required is None else asdict(self.required),
            "notes": list(self.notes),
        }


def check_study(folder: Path, instance: Path, today: date, agents: AgentProvider = learned_agents) -> Check:
    """Check a study's folder and compare its arms. Nothing is trained, and nothing is left behind.

    Args:
        folder: The study's folder.
        instance: Where its bundle is, if it was built.
        today: To tell a retention date that is over.
        agents: What a bundle that is up to date was made by.

    Raises:
        StudyError: The files cannot be used; the message has a line for each problem.
        BuildError: What the agent does cannot be shown as the study wants it.
    """
    _read(folder)
    built = find_built(folder, instance, agents)
    if built is not None:
        return _check(built, "learned", today, instance)
    with tempfile.TemporaryDirectory(prefix="xar-check-") as scratch:
        version = build(folder, Path(scratch), lambda *_: None, planner_agents).catalogue.version
        return _check(Path(scratch) / "bundles" / version, "planner", today, instance)


def _check(bundle: Path, agents: Literal["learned", "planner"], today: date, instance: Path) -> Check:
    catalogue = Catalogue.open(bundle)
    study = catalogue.study
    report: Sequence[Mapping[str, Any]] = json.loads((bundle / MANIFEST).read_text(encoding="utf-8"))["report"]
    arms, duration = compare_arms(catalogue, bundle, report), expected_duration(catalogue)
    notes = (*_before_live(study, today), *_of_arms(study, arms), *_of_rules(study, duration))
    required = read_required(instance, design_digest(study, plan_of(study)))
    return Check(study, agents, arms, duration, full_round(study), required, notes)


def _read(folder: Path) -> None:
    """Read everything; where the study file itself is wrong, look at least at the files that it surely means.

    Which texts a study needs, and whether names fit together, is not known before its file is right.
    """
    problems: list[str] = []
    try:
        read_sources(folder)
    except StudyError as error:
        problems += error.problems
    problems += _of_other_files(folder, folder / "study.toml")
    if problems:
        raise StudyError(problems)


def _of_other_files(folder: Path, file: Path) -> Iterator[str]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return
    try:
        study = parse_study(text, str(file))
    except StudyError:
        yield from _named_in(_tree(text), folder)
        return
    for path, message in setting_problems(study.learning.settings):
        yield located(text, str(file), path, message)
    try:
        check_plan(folder, study)
    except StudyError as error:
        yield from error.problems


def _named_in(tree: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """Yield what is wrong with the files that a study file names which cannot be used itself."""
    layouts = [] if "worlds" in tree else _names(tree.get("layouts"))
    for name in layouts:
        yield from _of_layout(folder / "layouts" / f"{name}.txt")
    for language in _names(tree.get("languages")):
        yield from _of_texts(folder / "texts" / f"{language}.toml", language)


def _of_layout(file: Path) -> Iterator[str]:
    try:
        tabulate(parse_layout(file.read_text(encoding="utf-8"), str(file)), str(file))
    except FileNotFoundError:
        yield f"{file}: is missing"
    except (OSError, UnicodeDecodeError) as error:
        yield f"{file}: cannot be read as UTF-8 text: {error}"
    except LayoutError as error:
        yield str(error)


def _of_texts(file: Path, language: str) -> Iterator[str]:
    try:
        parse_texts(file.read_text(encoding="utf-8"), language, str(file))
    except FileNotFoundError:
        yield f"{file}: is missing"
    except (OSError, UnicodeDecodeError) as error:
        yield f"{file}: cannot be read as UTF-8 text: {error}"
    except StudyError as error:
        yield from error.problems


def _tree(text: str) -> Mapping[str, Any]:
    try:
        return read_toml(text, "")
    except StudyError:
        return {}


def _names(value: object) -> list[str]:
    """Return the entries of a list that may be names of files; what is wrong with the others is told already."""
    names = [part for part in value if isinstance(part, str)] if isinstance(value, list) else []
    return list(dict.fromkeys(name for name in names if re.fullmatch(r"[a-z0-9_-]+", name)))


def _before_live(study: Study, today: date) -> Iterator[str]:
    if study.placeholders():
        yield f"before `xar serve --live`, fill in {', '.join(study.placeholders())}"
    elif date.fromisoformat(study.retention_until) <= today:
        yield f"retention_until is {study.retention_until}, which is not in the future"
    if study.quality == Quality():
        yield "no exclusion rules are declared; declare them in [quality] before there are data"
    if study.analysis is None or not study.analysis.contrasts:
        yield "no comparisons are planned; declare them in [analysis] before there are data"
    if study.analysis is None or study.analysis.plan is None:
        yield "no planned analysis in words is frozen with the study; name its file in [analysis]"
    for language in study.languages:
        if study.validation(language) == "unvalidated":
            yield f"{language}: rating items are an unvalidated translation; [translations.{language}] cites one"


def _of_arms(study: Study, arms: Sequence[ArmReport]) -> Iterator[str]:
    for report in arms:
        if len(study.experiment(report.experiment).kinds) == 1:
            yield f"experiment {report.experiment!r} has a single kind, so nothing is compared within it"
        for arm in report.arms:
            if arm.is_like_subgoals:
                where = f"experiment {report.experiment!r}, layout {arm.layout!r}"
                yield f"{where}: {arm.kind!r} shows exactly what the subgoals show, so nothing is compared there"


def _of_rules(study: Study, duration: Duration) -> Iterator[str]:
    least, each_round = study.quality.min_total_minutes, full_round(study)
    if least is not None and least > duration.shortest:
        yield f"quality.min_total_minutes is {least:g}, and the quickest may take {duration.shortest:.1f} minutes"
    if study.quota is not None and study.quota % each_round:
        nearest = max(each_round, study.quota - study.quota % each_round)
        yield f"quota is {study.quota}, no multiple of the {each_round} of a full round; {nearest} would be balanced"
