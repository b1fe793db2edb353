"""`xar rehearse` in earnest: a real server, bots on its real pages, the real export and report."""

import csv
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.web.servers import run as run_xar
from webapp.stimuli.agents import Agents, ReportProgress, planner_agents
from webapp.stimuli.build import build
from webapp.stimuli.sources import Sources

NUM_BOTS = 36
PLANTED = ("--effect", "subgoals=1.2", "--effect", "all_key_points=1.2")


def learned_agents(sources: Sources, progress: ReportProgress) -> Agents:
    """The planner under the name by which `xar rehearse` looks for bundles, because training takes minutes."""
    return planner_agents(sources, progress)


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    folder = tmp_path / "instance"
    build(ROOT / "webapp/studies/sakai2021", folder, lambda *_: None, learned_agents)
    return folder


def test_planted_effects_go_through_the_pages_into_the_report(instance: Path, tmp_path: Path) -> None:
    before = sorted(instance.rglob("*"))
    out = tmp_path / "results"
    words = ("sakai2021", "--participants", str(NUM_BOTS), *PLANTED, "--run", "first", "--out", str(out))
    done = run_xar(instance, "rehearse", *words, COLUMNS="100")
    folder = out / "rehearsal" / "first"
    rows = list(csv.DictReader((folder / "rehearsal.csv").read_text(encoding="utf-8").splitlines()))
    verdicts = [row["verdict"] for row in rows]
    # Which kind a bot sees on which layout is drawn anew each time: an interval may be off, no effect can be missed.
    assert len(verdicts) == 9, done.stderr
    assert set(verdicts) <= {"recovered", "off"}
    assert verdicts.count("recovered") >= 8
    assert done.returncode == (0 if verdicts.count("recovered") == 9 else 1), done.stderr
    assert ("recovered everything" in done.stdout) == (done.returncode == 0)
    assert {float(row["planted"]) for row in rows} == {1.2}
    assert sorted(instance.rglob("*")) == before
    report = (folder / "report" / "report.html").read_text(encoding="utf-8")
    assert "Planned comparisons" in report
    people = folder / "data" / "data" / "description-participants_data.csv"
    assert people.read_text(encoding="utf-8").count("\n") == NUM_BOTS + 1
