"""`xar explain`, as other programs and people at a terminal use it."""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tests.worlds import LAYOUTS
from webapp.cli import main

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = json.loads((ROOT / "tests/golden/method-numbers.json").read_text(encoding="utf-8"))
SIMULATION = ROOT / "webapp/studies/sakai2021/layouts/simulation.txt"


def xar(*arguments: str, layout: Path = SIMULATION) -> Result:
    return CliRunner().invoke(main, ["explain", "--layout", str(layout), *arguments])


def explained(*arguments: str, layout: Path = SIMULATION) -> dict[str, Any]:
    result = xar("--json", *arguments, layout=layout)
    assert (result.exit_code, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    assert isinstance(answer, dict)
    return answer


def steps(pairs: list[dict[str, Any]]) -> list[int]:
    return [pair["step"] for pair in pairs]


@pytest.mark.parametrize("kind", ["return_probability", "ace"])
@pytest.mark.parametrize("name", LAYOUTS)
def test_the_json_object_holds_the_methods_numbers(name: str, kind: str) -> None:
    layout = SIMULATION.with_name(f"{name}.txt")
    answer = explained("--importance", kind, "--random-steps", "20", layout=layout)
    known = GOLDEN[name]
    assert answer["states"] == known["states"]
    assert answer["actions"] == known["actions"]
    assert answer["importance"] == pytest.approx(known[kind]["20"]["importance"], abs=1e-9)
    assert answer["threshold"] == pytest.approx(known[kind]["20"]["threshold"], abs=1e-9)
    assert steps(answer["subgoals"]) == known[kind]["20"]["subgoal_steps"]


def test_the_json_object_has_exactly_the_agreed_parts_and_defaults() -> None:
    answer = explained()
    assert list(answer) == [
        "states",
        "actions",
        "importance",
        "standard_error",
        "threshold",
        "subgoals",
        "key_points",
        "explanation",
    ]
    assert answer["standard_error"] is None
    assert answer["key_points"] == []
    assert answer["explanation"] is None
    known = GOLDEN["simulation"]["return_probability"]["10"]
    assert answer["importance"] == pytest.approx(known["importance"], abs=1e-9)
    assert answer["subgoals"] == [
        {"step": step, "state": answer["states"][step - 1], "action": answer["actions"][step - 1]}
        for step in known["subgoal_steps"]
    ]


def test_a_question_is_answered_with_the_first_key_point() -> None:
    known = GOLDEN["simulation"]["query"]
    answer = explained("--route", ",".join(known["a_bad"]))
    assert steps(answer["key_points"]) == known["key_point_steps"]
    assert answer["explanation"] == answer["key_points"][0]


@pytest.mark.parametrize("name", ["experiment2-a", "experiment2-b"])
def test_a_question_asked_on_the_way_is_answered_from_there(name: str) -> None:
    known = GOLDEN[name]["query"]
    layout = SIMULATION.with_name(f"{name}.txt")
    route = ", ".join(known["a_bad"])
    answer = explained("--route", route, "--from-step", str(known["from_step"]), layout=layout)
    assert steps(answer["key_points"]) == known["key_point_steps"]
    assert answer["explanation"]["step"] == known["explanation_step"]


@pytest.mark.parametrize("kind", ["return_probability", "ace"])
def test_sampling_has_a_standard_error_for_every_state_and_depends_on_the_seed_alone(kind: str) -> None:
    options = ("--estimator", "monte-carlo", "--importance", kind)
    answer, again, other = explained(*options), explained(*options), explained(*options, "--seed", "1")
    assert len(answer["standard_error"]) == len(answer["importance"]) == len(answer["states"])
    assert answer == again
    assert answer["importance"] != other["importance"]
    few = explained(*options, "--trials", "10")
    assert max(few["standard_error"]) > 2 * max(answer["standard_error"])
    assert all(round(value * 10, 9).is_integer() for value in few["importance"])


def test_without_json_it_prints_a_picture() -> None:
    result = xar("--route", "left,left")
    assert result.exit_code == 0
    assert "simulation.txt\nexact world, planner, return probability after 10 random actions" in result.stdout
    assert "★ Explanation: step 7, pickup at (2, 1)" in result.stdout


def test_the_picture_says_how_it_was_sampled() -> None:
    result = xar("--estimator", "monte-carlo", "--trials", "5", "--seed", "3", "--importance", "ace")
    assert "average causal effect" in result.stdout
    assert "5 trials per state, seed 3" in " ".join(result.stdout.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--route", "forward,jump"], "'jump' is not an action; use forward, left, right, pickup, toggle"),
        (["--route", ""], "'' is not an action; use forward, left, right, pickup, toggle"),
        (["--route", "left", "--from-step", "21"], "there is no step 21; the path has steps 1 to 20"),
        (["--from-step", "21"], "there is no step 21; the path has steps 1 to 20"),
        (["--from-step", "0"], "'--from-step': 0 is not in the range"),
        (["--random-steps", "-1"], "'--random-steps': -1 is not in the range"),
        (["--random-steps", "1001"], "'--random-steps': 1001 is not in the range 0<=x<=1000"),
        (["--trials", "1000001"], "'--trials': 1000001 is not in the range"),
        (["--trials", "0"], "'--trials': 0 is not in the range"),
        (["--seed", "-1"], "'--seed': -1 is not in the range"),
        (["--random-steps", "many"], "'many' is not a valid integer"),
        (["--importance", "size"], "'size' is not one of"),
        (["--nonsense"], "No such option"),
    ],
)
def test_bad_input_is_one_line_and_status_two(arguments: list[str], message: str) -> None:
    result = xar(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("xar: ")
    assert result.stderr.count("\n") == 1
    assert message in result.stderr


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"#####\n#>KD#\n#####\n", "bad.txt, line 3, column 5: there is no goal (G)"),
        (b"######\n#>#KD#\n####G#\n######\n", "bad.txt, line 3, column 5: the goal cannot be reached"),
        (b"", "bad.txt, line 1, column 1: the map is empty"),
        (b"\xff\xfe\x00", "is not a text file"),
    ],
)
def test_a_map_that_cannot_be_used_is_one_line_and_status_two(tmp_path: Path, content: bytes, message: str) -> None:
    layout = tmp_path / "bad.txt"
    layout.write_bytes(content)
    result = xar(layout=layout)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.count("\n") == 1
    assert message in result.stderr


@pytest.mark.parametrize("name", ["missing.txt", "."])
def test_a_map_that_cannot_be_read_is_one_line_and_status_two(tmp_path: Path, name: str) -> None:
    result = xar(layout=tmp_path / name)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "cannot be read" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_map_must_be_given() -> None:
    result = CliRunner().invoke(main, ["explain"])
    assert (result.exit_code, result.stderr) == (2, "xar: Missing option '--layout'.\n")


def test_the_exact_world_is_explained_within_two_seconds_and_without_torch() -> None:
    program = (
        "import sys\n"
        "from webapp.cli import main\n"
        f"try:\n    main(['explain', '--layout', {str(SIMULATION)!r}, '--json'])\n"
        "finally:\n    print(sorted({'torch', 'minigrid', 'gymnasium', 'flask'} & set(sys.modules)), file=sys.stderr)\n"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    finished = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=os.environ, capture_output=True, text=True, check=False
    )
    # Time on the processor, since how long that takes on the wall depends on who else is at work.
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 2
    assert finished.returncode == 0
    assert finished.stderr == "[]\n"
    assert len(json.loads(finished.stdout)["states"]) == 21


def test_a_map_saved_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    layout = tmp_path / "saved-elsewhere.txt"
    layout.write_text(SIMULATION.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert explained(layout=layout) == explained()
