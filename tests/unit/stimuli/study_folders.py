"""Copies of the shipped study's folder, to be changed by tests."""

import shutil
from pathlib import Path

from webapp.stimuli.agents import Agents, ReportProgress, planner_agents
from webapp.stimuli.build import Built, build
from webapp.stimuli.sources import Sources

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


def change(file: Path, before: str, after: str) -> None:
    """Replace what stands once in a file."""
    text = file.read_text(encoding="utf-8")
    assert text.count(before) == 1, f"{before!r} stands {text.count(before)} times in {file}"
    file.write_text(text.replace(before, after), encoding="utf-8")


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
