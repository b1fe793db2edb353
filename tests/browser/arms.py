"""A small study for each kind of explanation, with everything around its only trial, built with the planner."""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.browser.site import Site, serve
from tests.conftest import ROOT
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build
from webapp.study.experiments import KEY_POINT_KINDS, Kind

STUDIES = ROOT / "webapp/studies"

_HEAD = """
name = "{name}"
seed = 5
languages = ["en", "ja"]
contact = "office@example.org"
ethics_approval = "Committee, 1"
retention_until = 2031-12-31
consent_version = "1"
layouts = ["practice", "{layout}"]
facts = ["goal", "key_and_door", "places_change"]
attention_checks = []

[consent]
minimum_age = 16
guardian_below = 18

[background]
questions = [
    {{ id = "age", type = "number", minimum = 16 }},
    {{ id = "robots", type = "choice", choices = ["never", "some", "often"] }},
]

[practice]
layout = "practice"

[[quiz.questions]]
id = "goal"
choices = ["key", "flag", "door"]
answer = "flag"

[debriefing]
discloses = [{discloses}]

[behaviour_log]

[[experiments]]
id = "{experiment}"
situation = "{situation}"
layouts = ["{layout}"]
kinds = ["{kind}"]
satisfaction = {satisfaction}
items = [{{ id = "likeliness", without_explanation = true }}, {{ id = "general" }}]

[experiments.drive]
when = "{when}"

[experiments.probe]
num_questions = 1
"""
_QUESTION = """
[experiments.question]
questioner = "door_open"
"""


def layout_of(kind: Kind) -> str:
    """The layout on which a kind is shown; key points answer a question, which comes with a video."""
    return "experiment2-a" if kind in KEY_POINT_KINDS else "experiment1-b"


def has_satisfaction(kind: Kind) -> bool:
    """Whether the satisfaction scale follows the ratings of a kind: in every third study, which is enough to see it."""
    return kind in {"subgoals", "all_key_points", "placebic", "tailored_first"}


def write_study(folder: Path, kind: Kind) -> Path:
    """Write the study of one kind; half of the kinds are rated before the drive, the others after it."""
    has_video = kind in KEY_POINT_KINDS
    study = folder / f"arm-{kind.replace('_', '-')}"
    shutil.copytree(STUDIES / "understanding/texts", study / "texts")
    (study / "layouts").mkdir()
    shutil.copy(STUDIES / "understanding/layouts/practice.txt", study / "layouts")
    shutil.copy(STUDIES / f"sakai2021/layouts/{layout_of(kind)}.txt", study / "layouts")
    text = _HEAD.format(
        name=study.name,
        layout=layout_of(kind),
        discloses=json.dumps("placebic") if kind == "placebic" else "",
        experiment="1",
        situation="video" if has_video else "current_view",
        kind=kind,
        satisfaction=json.dumps(has_satisfaction(kind)),
        when="before_ratings" if len(kind) % 2 else "after_ratings",
    )
    (study / "study.toml").write_text(text + (_QUESTION if has_video else ""), encoding="utf-8")
    return study


@contextmanager
def serve_arm(folder: Path, kind: Kind) -> Iterator[Site]:
    """Build the study of one kind and serve it."""
    study = write_study(folder / "studies", kind)
    build(study, folder / "built", progress=lambda *_: None, agents=planner_agents)
    (folder / "instance").mkdir()
    with serve(folder / "built", folder / "instance", study.name) as site:
        yield site
