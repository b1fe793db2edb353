"""`xar explain` and `xar compare` in environments that are not maps."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from webapp.cli import main

MAP = Path(__file__).resolve().parents[2] / "webapp/studies/sakai2021/layouts/simulation.txt"


def xar(*arguments: str, columns: int = 100) -> Result:
    return CliRunner().invoke(main, arguments, env={"COLUMNS": str(columns)})


def explained(*arguments: str) -> dict[str, Any]:
    result = xar("explain", "--json", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    assert isinstance(answer, dict)
    return answer


def test_a_lake_without_slipping_is_crossed_by_its_shortest_path() -> None:
    answer = explained("--env", "FrozenLake-v1", "--env-option", "is_slippery=false")
    assert len(answer["actions"]) == 6
    assert answer["states"][0] == [0, 0]
    assert answer["states"][-1] == [3, 3]
    assert len(answer["importance"]) == 7


def test_where_chance_has_a_say_the_most_probable_path_is_explained_with_a_bound() -> None:
    answer = explained("--env", "FrozenLake-v1")
    assert answer["error_bound"] < 1e-9
    assert all(0 <= value <= 1 for value in answer["importance"])
    averaged = explained("--env", "FrozenLake-v1", "--policy", "tie-averaged")
    assert averaged["states"] == answer["states"]


def test_a_route_in_an_environment_is_asked_about_with_its_own_actions() -> None:
    lake = ("--env", "FrozenLake-v1", "--env-option", "is_slippery=false")
    answer = explained(*lake, "--route", "right,right")
    assert [point["step"] for point in answer["key_points"]] == [point["step"] for point in answer["subgoals"]]
    result = xar("explain", *lake, "--route", "right,forward")
    assert result.exit_code == 2
    assert result.stderr == "xar: 'forward' is not an action; use left, down, right, up\n"


def test_the_reward_lost_is_an_importance_too() -> None:
    answer = explained("--env", "CliffWalking-v1", "--importance", "reward_importance", "--discount", "0.9")
    assert len(answer["actions"]) == 13
    assert max(answer["importance"]) > 0


@pytest.mark.parametrize("written", ["False", "false"])
def test_no_is_understood_however_it_is_written(written: str) -> None:
    answer = explained("--env", "FrozenLake-v1", "--env-option", f"is_slippery={written}")
    assert "error_bound" not in answer
    assert answer["about"]["environment"]["options"] == {"is_slippery": False}


@pytest.mark.parametrize("written", ["no", "FALSE", ""])
def test_a_text_for_yes_or_no_is_refused(written: str) -> None:
    result = xar("explain", "--env", "FrozenLake-v1", "--env-option", f"is_slippery={written}")
    assert (result.exit_code, result.stdout) == (2, "")
    expected = f"xar: the option 'is_slippery' of FrozenLake-v1 takes true or false, not {written!r}\n"
    assert result.stderr == expected


OWN = """
from webapp.explainer import Outcome

class Two:
    actions = ("go", "stay")
    start = "here"

    def outcomes(self, state, action):
        if action and {fails!r} == "outcomes":
            raise KeyError("lost")
        return [Outcome(1.0, "there" if action == 0 else "here", 0.0, action == 0)]

    def describe(self, state):
        if {fails!r} == "describe":
            raise KeyError("lost")
        return "\u00e9tat\\n" + state
"""


def own(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, fails: str) -> str:
    (folder / f"{name}.py").write_text(OWN.format(fails=fails), encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    return f"{name}:Two"


@pytest.mark.parametrize("fails", ["outcomes", "describe"])
def test_a_failure_of_ones_own_code_is_one_line_that_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    result = xar("explain", "--env", own(tmp_path, monkeypatch, f"failing_{fails}", fails))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"xar: Two.{fails} raised KeyError('lost') ")
    assert f"(failing_{fails}.py, line " in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_letters_that_the_terminal_lacks_are_written_as_escapes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = own(tmp_path, monkeypatch, "accented", "")
    runner = CliRunner(charset="ascii")
    result = runner.invoke(main, ["explain", "--env", name], env={"COLUMNS": "100"})
    assert (result.exit_code, result.stderr) == (0, "")
    assert "\\xe9tat here" in result.stdout


def test_an_environment_is_printed_state_by_state() -> None:
    result = xar("explain", "--env", "Taxi-v3", "--env-seed", "1")
    assert result.exit_code == 0
    assert "Taxi-v3 (now Taxi-v4, seed 1)" in result.stdout
    assert "dropoff" in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 100


def test_the_landmarks_of_a_taxi_are_pickup_and_dropoff() -> None:
    result = xar("compare", "--env", "Taxi-v3", "--env-seed", "1", "--k", "2", "--json")
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    actions = explained("--env", "Taxi-v3", "--env-seed", "1")["actions"]
    landmarks = next(each for each in answer["selectors"] if each["selector"] == "landmark facts")
    assert landmarks["steps"] == [actions.index("pickup") + 1, actions.index("dropoff") + 1]
    assert len(actions) == actions.index("dropoff") + 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "there is nothing to explain; give one of --layout FILE and --env ID"),
        (("--env", "Taxi-v3", "--layout", str(MAP)), "give one of --layout FILE and --env ID, not both"),
        (("--layout", str(MAP), "--env-seed", "1"), "--env-seed belongs to --env; a map has no use for it"),
        (("--layout", str(MAP), "--env-option", "a=1"), "--env-option belongs to --env; a map has no use for it"),
        (("--layout", str(MAP), "--actions", "left"), "--actions belongs to --env; a map has no use for it"),
        (("--env", "Taxi-v3", "--env-option", "rainy"), "is written KEY=VALUE, such as is_slippery=false, not 'rainy'"),
        (("--env", "FrozenLake-v1", "--max-states", "3"), "more than 3 states"),
        (("--env", "CartPole-v1"), "continuous"),
        (("--env", "FrozenLakes-v1"), "FrozenLake-v1"),
        (("--env", "FrozenLake-v1", "--policy", "dqn"), "trained for key-door maps only"),
    ],
)
@pytest.mark.parametrize("verb", ["explain", "compare"])
def test_what_cannot_be_explained_is_one_line_and_status_two(
    verb: str, arguments: tuple[str, ...], message: str
) -> None:
    result = xar(verb, *arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert message in result.stderr
    assert result.stderr.startswith("xar: ")
    assert len(result.stderr.splitlines()) == 1
