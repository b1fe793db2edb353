"""Copies of the shipped study's folder, to be changed by tests."""

import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from webapp.stimuli.agents import Agents, ReportProgress, planner_agents
from webapp.stimuli.build import Built, build
from webapp.stimuli.sources import SHARED_TEXTS, Sources
from webapp.study.texts import parse_texts

SHIPPED = Path(__file__).parents[3] / "webapp" / "studies" / "sakai2021"


def copy_study(folder: Path) -> Path:
    """Copy the shipped study into a folder and return the copy's."""
    return Path(shutil.copytree(SHIPPED, folder / "studies" / SHIPPED.name))


def small_study(folder: Path) -> Path:
    """Write a study of one trial into a folder, with the shipped texts, and return its own folder.

    It has few pictures, so that it is built quickly.
    """
    study = copy_study(folder)
    head, _, _ = (study / "study.toml").read_text(encoding="utf-8").partition("layouts = [")
    (study / "study.toml").write_text(head + SMALL, encoding="utf-8")
    return study


SMALL = """
layouts = ["experiment1-a"]
facts = ["goal", "key_and_door"]

[explanation]
num_draws = 10

[[experiments]]
id = "1"
situation = "current_view"
layouts = ["experiment1-a"]
kinds = ["random"]

[[experiments.items]]
id = "general"
"""
"""The end of the small study's file."""


ARMS = ["none", "placebic", "highlights", "landmarks", "evenly_spaced"]
TAILORED = ["tailored_all", "tailored_first"]


def study_of_all_kinds(folder: Path) -> Path:
    """Copy the shipped study, let each experiment have every kind that it can have, drives and predictions."""
    study = copy_study(folder)
    file = study / "study.toml"
    extras = "drive = {}\nprobe = { num_questions = 3, states = "
    change(file, *_more_kinds(["full", "subgoals", "random"], extras + '"elsewhere" }'))
    change(file, *_more_kinds(["all_key_points", "first_key_point"], extras + '"path" }'))
    change(file, "[explanation]\n", '[debriefing]\ndiscloses = ["placebic"]\n\n[explanation]\n')
    set_texts(study, {"debriefing.placebic": "One of the explanations said nothing."})
    return study


def _more_kinds(kinds: list[str], extras: str) -> tuple[str, str]:
    return f"kinds = {json.dumps(kinds)}", f"kinds = {json.dumps([*kinds, *ARMS, *TAILORED])}\n{extras}"


def set_texts(study: Path, texts: Mapping[str, str | None]) -> None:
    """Give a study texts of its own in English, by full key, in place of those it had; None takes one away."""
    file = study / "texts" / "en.toml"
    _write_texts(file, {**_read_texts(file), **texts})


def set_languages(study: Path, *languages: str) -> None:
    """Let a study have these languages; one without texts of its own gets all the English ones."""
    file = study / "study.toml"
    declared = f"languages = {json.dumps(languages)}"
    text, count = re.subn(r"^languages = .*$", declared, file.read_text("utf-8"), flags=re.MULTILINE)
    assert count == 1
    file.write_text(text, encoding="utf-8")
    for language in languages:
        if not (study / "texts" / f"{language}.toml").exists():
            english = {**_read_texts(SHARED_TEXTS / "en.toml"), **_read_texts(study / "texts" / "en.toml")}
            _write_texts(study / "texts" / f"{language}.toml", english)


def _read_texts(file: Path) -> Mapping[str, str | tuple[str, ...]]:
    return parse_texts(file.read_text(encoding="utf-8"), file.stem, file.name).entries


def _write_texts(file: Path, entries: Mapping[str, str | tuple[str, ...] | None]) -> None:
    """Write texts by their full keys, without tables."""
    lines = [f"{json.dumps(key)} = {json.dumps(text)}\n" for key, text in entries.items() if text is not None]
    file.write_text("".join(lines), encoding="utf-8")


def change(file: Path, before: str, after: str) -> None:
    """Replace what stands once in a file."""
    text = file.read_text(encoding="utf-8")
    assert text.count(before) == 1, f"{before!r} stands {text.count(before)} times in {file}"
    file.write_text(text.replace(before, after), encoding="utf-8")


def without_plan(study: Path) -> None:
    """Take the planned comparisons away from a study, whose kinds are then free to change."""
    file = study / "study.toml"
    text, count = re.subn(r"\[analysis\].*?\n\n", "", file.read_text("utf-8"), flags=re.DOTALL)
    assert count == 1
    file.write_text(text, encoding="utf-8")


def quietly(*_: object) -> None:
    """Take a report of progress and do nothing."""


def plan_and_build(study: Path, instance: Path) -> Built:
    """Build with agents that plan."""
    return build(study, instance, quietly, planner_agents)


def nobody(sources: Sources, progress: ReportProgress) -> Agents:
    """Refuse to provide agents, to show that none are asked for."""
    raise AssertionError(f"agents were asked for: {sources.study.name}, {progress}")


def files_of(folder: Path) -> dict[str, bytes]:
    """Return the bytes of every file below a folder, by its path within."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
