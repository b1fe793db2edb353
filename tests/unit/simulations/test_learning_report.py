"""What a sweep leaves in its folder, from rows whose truth is known."""

import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from webapp.simulations import count, importance, usefulness
from webapp.simulations.conditions import planned_runs
from webapp.simulations.console import claims_table
from webapp.simulations.importance_settings import ImportanceSettings
from webapp.simulations.settings import SweepSettings
from webapp.simulations.sweeps import as_rows

DICTIONARY = Path(__file__).parents[3] / "docs" / "data-dictionary.md"
BUDGET = 200
NEVER = frozenset({"evenly spaced", "behind the start"})


def invented(settings: SweepSettings, experiment: object) -> pd.DataFrame:
    """Invent rows: told agents are faster, those of some groups never learn."""
    rng = np.random.default_rng(0)
    rows = []
    for run in planned_runs(experiment.conditions(settings), settings.num_runs):  # type: ignore[attr-defined]
        group = run.condition
        episodes = BUDGET if group.name in NEVER else int(rng.integers(20, 40)) + 60 * (group.variant == "none")
        rows.append(
            {
                "run_id": run.run_id,
                "condition": group.name,
                "kind": group.kind,
                "variant": group.variant,
                "steps": group.told,
                "keeps_optimum": int(group.keeps_optimum),
                "number": run.number,
                "episodes": episodes,
                "is_optimal": int(episodes < BUDGET),
                "actions": 100 * episodes,
                "goals": 0 if episodes == BUDGET else 3,
                "first_goal": None if episodes == BUDGET else 1,
            }
        )
    return as_rows(rows)


@pytest.fixture(scope="module")
def useful() -> tuple[usefulness.UsefulnessSettings, pd.DataFrame, dict[str, bytes]]:
    settings = replace(usefulness.SETTINGS["paper"], num_resamples=300)
    rows = invented(settings, usefulness)
    return settings, rows, usefulness.summarise(settings, rows)


@pytest.fixture(scope="module")
def counted() -> tuple[count.CountSettings, pd.DataFrame, dict[str, bytes]]:
    settings = replace(count.SETTINGS["paper"], num_resamples=300)
    rows = invented(settings, count)
    return settings, rows, count.summarise(settings, rows)


def read(files: dict[str, bytes], name: str) -> pd.DataFrame:
    return pd.read_csv(BytesIO(files[name]))


def described(title: str) -> list[str]:
    """The columns that the data dictionary describes under a heading."""
    text = DICTIONARY.read_text(encoding="utf-8")
    section = re.search(rf"^### `{re.escape(title)}`$(.*?)(?=^##|\Z)", text, flags=re.MULTILINE | re.DOTALL)
    assert section is not None, title
    return re.findall(r"^\| `(\w+)` \| [^|]+ \| [^|]+ \|$", section[1], flags=re.MULTILINE)


@pytest.mark.parametrize("name", ["rows.csv", "conditions.csv", "comparisons.csv", "claims.csv"])
def test_the_data_dictionary_describes_every_column(
    name: str,
    useful: tuple[object, pd.DataFrame, dict[str, bytes]],
    counted: tuple[object, pd.DataFrame, dict[str, bytes]],
) -> None:
    for _, _, files in (useful, counted):
        assert list(read(files, name).columns) == described(f"simulations/{name}")


def test_the_data_dictionary_describes_the_importance_experiment(tmp_path: Path) -> None:
    settings: ImportanceSettings = replace(importance.SETTINGS["quick"], num_trials=20)
    rows = importance.run(settings, tmp_path, lambda stage, done: None)  # noqa: ARG005
    files = importance.summarise(settings, rows)
    for name in ("rows.csv", "claims.csv"):
        assert list(read(files, name).columns) == described(f"simulations/importance/{name}")


def test_runs_that_never_learned_are_counted_and_their_means_marked(
    useful: tuple[object, pd.DataFrame, dict[str, bytes]],
) -> None:
    table = read(useful[2], "conditions.csv").set_index(["variant", "condition"])
    never = table.loc[("once", "evenly spaced")]
    assert (never["runs"], never["censored"], never["mean"], never["iqm"]) == (10, 10, BUDGET, BUDGET)
    assert never["mean_is_lower_bound"] == never["iqm_is_lower_bound"] == 1
    derived = table.loc[("once", "derived")]
    assert (derived["censored"], derived["mean_is_lower_bound"], derived["iqm_is_lower_bound"]) == (0, 0, 0)
    assert table["runs"].sum() == len(useful[1])
    assert "10 of 10" in useful[2]["summary.md"].decode()
    assert "> 200.0" in useful[2]["summary.md"].decode()


def test_the_summary_has_every_claim_with_its_verdict_and_shows_the_figures(
    useful: tuple[object, pd.DataFrame, dict[str, bytes]],
    counted: tuple[object, pd.DataFrame, dict[str, bytes]],
) -> None:
    for name, (_, _, files) in (("usefulness", useful), ("count", counted)):
        text = files["summary.md"].decode()
        for claim in read(files, "claims.csv").to_dict("records"):
            assert re.search(rf"\| {re.escape(claim['statement'])} .*\*\*{claim['verdict']}\*\*", text)
        for figure in (f"{name}.svg", "learned.svg"):
            assert f"]({figure})" in text
            assert figure in files


def test_what_the_invented_agents_did_comes_out(useful: tuple[object, pd.DataFrame, dict[str, bytes]]) -> None:
    claims = read(useful[2], "claims.csv").set_index(["statement", "variant"])["verdict"]
    assert claims["the derived subgoals need fewer episodes than no sub-reward", "once"] == "holds"
    control = "pairs behind the start need no fewer episodes than no sub-reward (control)"
    assert claims[control, "once"] == "holds"
    # All groups but two are drawn from one distribution, so random steps are as good as the derived ones.
    shared_none = "random steps that share no derived subgoal need more episodes"
    assert claims[shared_none, "repeatable"] in {"does not hold", "undecided"}


@pytest.mark.parametrize("name", ["usefulness.svg", "learned.svg"])
def test_figures_are_pictures_with_the_names_of_the_groups(
    name: str, useful: tuple[object, pd.DataFrame, dict[str, bytes]]
) -> None:
    root = ET.fromstring(useful[2][name])  # noqa: S314 - our own file.
    assert root.tag.endswith("svg")
    comments = useful[2][name].decode()
    for label in ("no sub-reward", "behind the start", "paid once per episode"):
        assert label in comments
    with Image.open(BytesIO(useful[2][name.replace(".svg", ".png")])) as picture:
        assert picture.width >= 1400


def test_the_order_of_the_rows_does_not_matter_and_a_changed_row_does(
    counted: tuple[count.CountSettings, pd.DataFrame, dict[str, bytes]],
) -> None:
    settings, rows, files = counted
    again = count.summarise(settings, rows.sample(frac=1, random_state=1).sort_index())
    assert again == files
    changed = rows.copy()
    changed.loc[0, "episodes"] += 1
    other = count.summarise(settings, changed)
    assert other["conditions.csv"] != files["conditions.csv"]
    assert other["count.svg"] != files["count.svg"]


def test_the_terminal_shows_every_claim_once(useful: tuple[object, pd.DataFrame, dict[str, bytes]]) -> None:
    claims = read(useful[2], "claims.csv")
    table = claims_table(claims)
    assert table.row_count == len(claims)  # type: ignore[union-attr]  # A table it is.
