"""What `xar explain` says of how far to trust an explanation: thresholds, sampling, stability, granularity."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from webapp.cli import main

SIMULATION = Path(__file__).resolve().parents[2] / "webapp/studies/sakai2021/layouts/simulation.txt"


def xar(*arguments: str, columns: int = 100) -> Result:
    environment = {"COLUMNS": str(columns)}
    return CliRunner().invoke(main, ["explain", "--layout", str(SIMULATION), *arguments], env=environment)


def explained(*arguments: str) -> dict[str, Any]:
    result = xar("--json", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    assert isinstance(answer, dict)
    return answer


def steps(answer: dict[str, Any]) -> list[int]:
    return [pair["step"] for pair in answer["subgoals"]]


def test_top_k_finds_as_many_subgoals_as_wished_and_says_its_level() -> None:
    values = explained()["importance"]
    for k in (1, 2, 3):
        answer = explained("--threshold", "top-k", "--k", str(k))
        assert len(steps(answer)) == k
        level = answer["threshold"]
        assert all(values[step - 1] > level > values[step] for step in steps(answer))
    assert "top k" in xar("--threshold", "top-k", "--k", "2").stdout


def test_the_tie_averaged_policy_explains_the_planners_path() -> None:
    planned, averaged = explained(), explained("--policy", "tie-averaged")
    assert averaged["actions"] == planned["actions"]
    assert averaged["importance"] != planned["importance"]


def test_the_reward_lost_at_a_step_is_one_of_the_importances() -> None:
    answer = explained("--importance", "reward_importance", "--discount", "0.9")
    assert answer["importance"][6] == pytest.approx(0.9**13)
    assert "discount 0.9" in xar("--importance", "reward_importance", "--discount", "0.9").stdout


def test_sampling_says_why_it_ended() -> None:
    settled = xar("--estimator", "monte-carlo", "--trials", "100000", "--stop-early").stdout
    assert "every step's side of the threshold is settled at 95 %" in settled
    spent = xar("--estimator", "monte-carlo", "--trials", "100", "--stop-early").stdout
    assert "Sampling ended after 100 trials per state, its budget. Not settled at 95 %" in " ".join(spent.split())
    sampling = explained("--estimator", "monte-carlo", "--trials", "100", "--stop-early")["sampling"]
    assert (sampling["trials"], sampling["stopped"], sampling["truncated"]) == (100, "budget", 0)
    assert sampling["unsettled"]


def test_stability_counts_each_step_and_draws_a_picture_once(tmp_path: Path) -> None:
    picture = tmp_path / "stability.svg"
    result = xar("--stability", "--picture", str(picture))
    assert result.exit_code == 0
    assert "explained in 384 ways" in result.stdout
    assert "flips" in result.stdout
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
    again = xar("--stability", "--picture", str(picture))
    assert (again.exit_code, again.stdout) == (2, "")
    assert "exists already; remove it or choose another name" in again.stderr


def test_stability_as_json_names_what_was_tried() -> None:
    answer = explained("--stability", "--random-steps", "5", "--threshold", "largest-gap")
    assert answer["settings"]["random_steps"] == 5
    assert len(answer["steps"]) == 20


@pytest.mark.parametrize(("granularity", "num_steps"), [("steps", 20), ("events", 9), ("rooms", 4)])
def test_one_path_is_explained_at_three_granularities(granularity: str, num_steps: int) -> None:
    answer = explained("--granularity", granularity)
    assert len(answer["actions"]) == num_steps
    printed = xar("--granularity", granularity)
    assert printed.exit_code == 0
    assert max(map(len, printed.stdout.splitlines())) <= 100


def test_a_question_is_put_and_answered_at_the_granularity_of_the_explanation() -> None:
    answer = explained("--granularity", "events", "--route", "left,left")
    assert answer["key_points"] == answer["subgoals"]
    assert answer["explanation"]["action"] == "take the key"
    assert answer["explanation"]["steps"] == [6, 7]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--threshold", "top-k"], "a number of subgoals belongs to the threshold top-k, and top-k needs it"),
        (["--k", "2"], "a number of subgoals belongs to the threshold top-k"),
        (["--threshold", "top-k", "--k", "19"], "k = 19 cannot be met"),
        (["--stop-early"], "only sampling can stop early; take the monte-carlo estimator"),
        (["--discount", "1"], "the discount must lie above 0 and below 1, not 1.0"),
        (["--importance", "reward_importance", "--estimator", "monte-carlo"], "cannot be sampled"),
        (["--route", ""], "a route has at least one action; leave it out when nobody asks"),
        (["--trials", "10"], "--trials belongs to --estimator monte-carlo"),
        (["--language", "en", "--stability"], "--language belongs to the sentences below a map's steps"),
        (["--language", "ja", "--granularity", "events"], "--language belongs to the sentences below a map's steps"),
        (["--max-states", "3"], "--max-states belongs to --env; a map has no use for it"),
        (["--granularity", "rooms", "--estimator", "monte-carlo"], "rooms are explained exactly, not by sampling"),
        (["--stability", "--route", "left"], "--stability asks about no route"),
        (["--stability", "--granularity", "rooms"], "--stability is about steps; leave --granularity out"),
        (["--stability", "--estimator", "monte-carlo"], "--stability explains exactly; leave --estimator out"),
        (["--stability", "--picture", "nowhere/a.png"], "there is no folder 'nowhere' for the picture"),
        (["--stability", "--picture", "a.pdf"], "a picture is a .png or .svg file, and 'a.pdf' is neither"),
        (["--picture", "a.png"], "--picture belongs to --stability; ask for that, or leave it out"),
        (["--training-seeds", "1"], "--training-seeds belongs to --stability; ask for that, or leave it out"),
        (["--stability", "--training-seeds", "a"], "--training-seeds takes whole numbers with commas between, not 'a'"),
        (["--stability", "--training-seeds", "1,1"], "--training-seeds takes different numbers from 0 on, not '1,1'"),
        (["--from-step", "21", "--granularity", "rooms", "--route", "left"], "there is no step 21"),
    ],
)
def test_what_contradicts_itself_is_one_line_and_status_two(arguments: list[str], message: str) -> None:
    result = xar(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_belief_is_told_in_steps_and_then_as_coarsely_as_the_explanation(tmp_path: Path) -> None:
    believed = tmp_path / "other.txt"
    text = SIMULATION.read_text(encoding="utf-8")
    believed.write_text(text.replace("#...D..#", "#...#..#").replace("#...#..#", "#...D..#", 1), encoding="utf-8")
    lines = xar("--granularity", "events", "--believed-layout", str(believed), columns=300).stdout.splitlines()
    asked = next(place for place, line in enumerate(lines) if line.startswith("Asked at step 1"))
    assert "by somebody who believes in other.txt, and so in the route" in lines[asked]
    assert lines[asked + 1].startswith("Seen so coarsely, at step 1: go to the key, take the key")


def test_granularities_and_trainings_belong_to_maps() -> None:
    for arguments, message in (
        (["--granularity", "rooms"], "rooms are known for key-door maps only, not for 'FrozenLake-v1'"),
        (["--stability", "--training-seeds", "1"], "agents are trained for key-door maps only"),
    ):
        result = CliRunner().invoke(main, ["explain", "--env", "FrozenLake-v1", *arguments])
        assert (result.exit_code, result.stdout) == (2, "")
        assert message in result.stderr


def test_the_stability_of_a_slippery_world_is_found_without_ties() -> None:
    result = CliRunner().invoke(main, ["explain", "--env", "FrozenLake-v1", "--stability", "--json"])
    assert (result.exit_code, result.stderr) == (0, "")
    assert len(json.loads(result.stdout)["steps"]) == 6
