"""`xar compare`, as other programs and people at a terminal use it."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from webapp.cli import main
from webapp.explainer.comparison import SELECTORS

SIMULATION = Path(__file__).resolve().parents[2] / "webapp/studies/sakai2021/layouts/simulation.txt"


def xar(*arguments: str, layout: Path = SIMULATION, columns: int = 80) -> Result:
    environment = {"COLUMNS": str(columns)}
    return CliRunner().invoke(main, ["compare", "--layout", str(layout), *arguments], env=environment)


def test_the_json_object_has_every_selector_with_its_curve() -> None:
    result = xar("--json", "--k", "4", "--alpha", "0.9")
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    assert (answer["num_steps"], answer["k"], answer["alpha"], answer["subgoals"]) == (20, 4, 0.9, [7, 16, 20])
    assert [each["selector"] for each in answer["selectors"]] == list(SELECTORS)
    for each in answer["selectors"]:
        assert set(each) >= {"selector", "steps", "overlap", "fidelity", "drop", "seconds", "curve", "smallest_k"}
        assert set(each) >= {"source", "reasons", "own", "frames", "note"}
        assert len(each["curve"]) == 21
        assert each["steps"] is None or len(each["steps"]) == 4


@pytest.mark.parametrize("columns", [80, 120])
def test_both_tables_fit_the_terminal_and_name_every_selector(columns: int) -> None:
    result = xar(columns=columns)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= columns
    for name in SELECTORS:
        assert sum(line.startswith(f"{name}  ") for line in lines) == 2
    assert "subgoals        7, 16, 20" in result.stdout
    assert "█" in result.stdout
    assert "…" not in result.stdout


def test_a_long_choice_of_steps_is_wrapped_and_not_cut() -> None:
    result = xar("--k", "20", "--importance", "ace", "--random-steps", "5")
    assert result.exit_code == 0
    assert max(map(len, result.stdout.splitlines())) <= 80
    assert result.stdout.count("20 of 20") == 0
    assert result.stdout.count("3 of 20") == len(SELECTORS) - 1
    assert "average causal effect after 5 random actions" in " ".join(result.stdout.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--k", "21"], "k must be at most 20, the number of the path's steps, not 21"),
        (["--k", "0"], "'--k': 0 is not in the range"),
        (["--alpha", "1"], "alpha must be 0 or larger and below 1, not 1.0"),
        (["--alpha", "-0.1"], "alpha must be 0 or larger and below 1, not -0.1"),
        (["--alpha", "nan"], "alpha must be 0 or larger and below 1, not nan"),
        (["--random-steps", "-1"], "'--random-steps': -1 is not in the range"),
        (["--seed", "-1"], "'--seed': -1 is not in the range"),
        (["--policy", "luck"], "'luck' is not one of"),
    ],
)
def test_bad_input_is_one_line_and_status_two(arguments: list[str], message: str) -> None:
    result = xar(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("xar: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_map_that_is_not_there_is_one_line_and_status_two(tmp_path: Path) -> None:
    result = xar(layout=tmp_path / "nowhere.txt")
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "cannot be read" in result.stderr
