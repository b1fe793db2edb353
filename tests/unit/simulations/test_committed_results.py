"""The results in the repository: complete, made with today's settings, and what today's code makes of their rows."""

import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd
import pytest

from tests.conftest import ROOT
from webapp.simulations import count, importance, usefulness
from webapp.simulations.claims import overall

RESULTS = ROOT / "results" / "simulations"
SWEEPS = [(experiment, preset) for experiment in (usefulness, count) for preset in ("paper", "ours")]
EVERY = [*((experiment.NAME, preset) for experiment, preset in SWEEPS), ("importance", "paper"), ("importance", "ours")]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def told(files: dict[str, bytes]) -> dict[str, str]:
    """What is told in words and numbers. Pictures may differ in last bits from machine to machine."""
    return {name: content.decode() for name, content in files.items() if name.endswith((".csv", ".md"))}


def committed(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text(encoding="utf-8") for file in folder.iterdir() if file.suffix in {".csv", ".md"}}


@pytest.mark.parametrize(("name", "preset"), EVERY)
def test_every_run_is_complete_and_says_where_it_comes_from(name: str, preset: str) -> None:
    folder = RESULTS / name / preset
    about = json.loads((folder / "run.json").read_text())
    assert re.fullmatch(r"[0-9a-f]{40}", about["commit"])
    assert about["command"] in (ROOT / "results/README.md").read_text(encoding="utf-8")
    assert not (folder / "journal.jsonl").exists()
    assert f"{name}.svg" in committed_names(folder)
    assert f"{name}.png" in committed_names(folder)


def committed_names(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir()}


def settings_of(experiment: Any, preset: str) -> Any:  # noqa: ANN401 - of whichever experiment.
    """Today's settings, which must be the committed run's."""
    settings = experiment.SETTINGS[preset]
    name = experiment.__name__.rpartition(".")[2]
    stored = json.loads((RESULTS / name / preset / "settings.json").read_text())
    assert stored["settings"] == json.loads(json.dumps(settings.to_dict()))
    return settings


@pytest.mark.slow
@pytest.mark.parametrize(("experiment", "preset"), SWEEPS)
def test_tables_and_summary_of_a_sweep_follow_from_its_rows(experiment: ModuleType, preset: str) -> None:
    folder = RESULTS / experiment.NAME / preset
    rows = pd.read_csv(folder / "rows.csv").astype({"first_goal": "Int64"})
    settings = settings_of(experiment, preset)
    assert len(rows) == len(experiment.conditions(settings)) * settings.num_runs
    assert told(experiment.summarise(settings, rows)) == committed(folder)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "ours"])
def test_tables_and_summary_of_the_importance_experiment_follow_from_its_rows(preset: str) -> None:
    folder = RESULTS / "importance" / preset
    rows = pd.read_csv(folder / "rows.csv")
    assert told(importance.summarise(settings_of(importance, preset), rows)) == committed(folder)


@pytest.mark.parametrize("experiment", [usefulness, count])
def test_ten_runs_are_the_first_of_the_thirty(experiment: ModuleType) -> None:
    few, many = (pd.read_csv(RESULTS / experiment.NAME / preset / "rows.csv") for preset in ("paper", "ours"))
    assert few.equals(many[many["number"] < 10].reset_index(drop=True))


def test_the_readme_has_the_verdict_of_every_claim_of_the_paper() -> None:
    for name in ("usefulness", "count"):
        claims = pd.read_csv(RESULTS / name / "ours" / "claims.csv")
        for claim in claims[claims["source"].str.startswith("5.")].to_dict("records"):
            row = rf"\| {re.escape(claim['source'])} \| {re.escape(claim['statement'])} \| {claim['variant']} \|"
            assert re.search(rf"{row}[^\n]*\| {claim['verdict']} \|", README), claim
    importances = pd.read_csv(RESULTS / "importance" / "ours" / "claims.csv")
    assert re.search(rf"\| 5\.1 \|[^\n]*\| {overall(importances['verdict'].tolist())} \|", README)
