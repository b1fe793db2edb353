"""The study of the load tests: consent, three pictures with three ratings each, the end."""

import shutil
from pathlib import Path

from tests.conftest import ROOT
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build

NAME = "load"
ITEMS = ("likeliness", "loveliness", "general")
LAYOUTS = ("experiment1-a", "experiment1-b", "experiment1-c")

_STUDY = """
name = "{name}"
seed = 1
languages = ["en"]
contact = "<contact>"
ethics_approval = "<approval>"
retention_until = "<date>"
consent_version = "1"
layouts = [{layouts}]
facts = ["goal", "key_and_door", "places_change"]

[[experiments]]
id = "1"
situation = "current_view"
layouts = [{layouts}]
kinds = ["{kind}"]
"""
_ITEM = """
[[experiments.items]]
id = "{item}"
points = 5
without_explanation = true
"""


def build_load_study(scratch: Path, kind: str = "none") -> Path:
    """Build the study with the planner in the agents' place; return the instance that holds it.

    Its pages are the instructions and, three times, a page with the current view and a page with three ratings: four
    pages more than the shape asks for, because our trials show the situation on a page of its own.

    Args:
        scratch: A folder.
        kind: What is shown above the ratings; `none` for nothing, so that each trial has one picture.
    """
    shipped, folder, instance = ROOT / "webapp/studies/sakai2021", scratch / NAME, scratch / "built"
    shutil.copytree(shipped / "texts", folder / "texts")
    (folder / "texts/ja.toml").unlink()
    (folder / "layouts").mkdir()
    for layout in LAYOUTS:
        shutil.copy(shipped / "layouts" / f"{layout}.txt", folder / "layouts")
    layouts = ", ".join(f'"{layout}"' for layout in LAYOUTS)
    text = _STUDY.format(name=NAME, layouts=layouts, kind=kind)
    text += "".join(_ITEM.format(item=item) for item in ITEMS)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    build(folder, instance, lambda *_: None, agents=planner_agents)
    return instance
