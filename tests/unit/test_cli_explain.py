"""`xar explain`, as other programs and people at a terminal use it."""

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tests.worlds import LAYOUTS
from webapp.cli import main
from webapp.explainer.pictures.sentences import LANGUAGES

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
        "about",
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


def test_the_json_object_says_what_it_is_about() -> None:
    about = explained("--importance", "ace", "--random-steps", "5", "--seed", "4")["about"]
    assert about["source"] == "simulation.txt"
    assert about["layout"] == SIMULATION.read_text(encoding="utf-8").splitlines()
    chosen = ("world", "policy", "importance", "estimator", "granularity", "random_steps", "seed", "threshold_rule")
    assert [about[name] for name in chosen] == ["exact", "planner", "ace", "exact", "steps", 5, 4, "mean"]
    assert about["route"] is None


def test_what_cannot_be_written_is_one_line_and_status_two() -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        for more in ((), ("--json",)):
            command = [
                sys.executable,
                "-c",
                "from webapp.cli import main; main()",
                "explain",
                "--layout",
                str(SIMULATION),
            ]
            ended = subprocess.run([*command, *more], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
            assert ended.returncode == 2
            assert ended.stderr.splitlines()[0] == "xar: the answer cannot be written: No space left on device"


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
        (["--route", "left,"], "'' is not an action; use forward, left, right, pickup, toggle"),
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
    assert (result.exit_code, result.stderr) == (
        2,
        "xar: there is nothing to explain; give one of --layout FILE and --env ID\n",
    )


SIMULATION_MAP = SIMULATION.read_text(encoding="utf-8")
OTHER_DOOR = SIMULATION_MAP.replace("#...D..#", "#...#..#").replace("#...#..#", "#...D..#", 1)


@pytest.fixture
def other_door(tmp_path: Path) -> Path:
    """The map of somebody who believes that the door is at (4, 2)."""
    path = tmp_path / "other-door.txt"
    path.write_text(OTHER_DOOR, encoding="utf-8")
    return path


def test_a_misunderstood_door_is_explained(other_door: Path) -> None:
    known = GOLDEN["simulation"]["query"]
    answer = explained("--believed-layout", str(other_door))
    assert steps(answer["key_points"]) == known["key_point_steps"] == [16, 20]
    assert answer["explanation"]["step"] == known["explanation_step"] == 16
    routed = explained("--route", ",".join(known["a_bad"]))
    assert answer.pop("about")["route"] == routed.pop("about")["route"] == known["a_bad"]
    assert answer == routed


def test_a_mistaken_world_is_shown_beside_what_comes_of_it(other_door: Path) -> None:
    text = " ".join(xar("--believed-layout", str(other_door)).stdout.split())
    route = ", ".join(GOLDEN["simulation"]["query"]["a_bad"])
    assert f"Asked at step 1 by somebody who believes in other-door.txt, and so in the route {route}." in text
    assert "as believed" in text
    assert "what comes of it" in text
    assert "It misses step 16 (forward) and step 20 (forward)." in text


def test_a_mistake_is_made_from_the_state_of_the_step_at_which_it_is_asked(other_door: Path) -> None:
    result = xar("--believed-layout", str(other_door), "--from-step", "10")
    text = " ".join(result.stdout.split())
    asked = text.split("the route ")[1].split(".")[0].split(", ")
    assert asked.count("toggle") == 1
    assert "pickup" not in asked
    answer = explained("--believed-layout", str(other_door), "--from-step", "10")
    routed = explained("--route", ",".join(asked), "--from-step", "10")
    believed, given = answer.pop("about"), routed.pop("about")
    assert answer == routed
    assert believed["route"] == given["route"] == asked
    assert believed["believed_layout"] == other_door.read_text(encoding="utf-8").splitlines()
    assert given["believed_layout"] is None


def test_who_is_not_mistaken_misses_nothing() -> None:
    answer = explained("--believed-layout", str(SIMULATION), "--from-step", "5")
    assert (answer["key_points"], answer["explanation"]) == ([], None)


@pytest.mark.parametrize(
    ("believed", "arguments", "message"),
    [
        (
            "#####\n#>KD#\n###G#\n#####\n",
            [],
            "other.txt, line 4, column 5: the believed map is 5 cells wide and 4 high",
        ),
        (SIMULATION_MAP.replace("#.^.#", "#^#.#"), [], "line 7, column 3: the agent stands at (2, 6), where this bel"),
        (SIMULATION_MAP.replace("#.G#", "##G#").replace("D..#", "D###"), [], "line 7, column 7: on this believed map"),
        (SIMULATION_MAP.replace("#...D..#", "#...#..#").replace("K.", "KD"), ["--from-step", "16"], "(4, 4), where"),
        (SIMULATION_MAP.replace("K", "x"), [], "other.txt, line 2, column 2: 'x' is not a map character"),
        (SIMULATION_MAP, ["--route", "left"], "a route and a believed map are two ways of asking; give one of them"),
        (SIMULATION_MAP, ["--from-step", "21"], "there is no step 21; the path has steps 1 to 20"),
    ],
)
def test_a_belief_that_cannot_be_used_is_one_line_and_status_two(
    tmp_path: Path, believed: str, arguments: list[str], message: str
) -> None:
    path = tmp_path / "other.txt"
    path.write_text(believed, encoding="utf-8")
    result = xar("--believed-layout", str(path), *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("xar: ")
    assert result.stderr.count("\n") == 1
    assert message in result.stderr


def test_a_believed_map_that_is_not_there_is_one_line_and_status_two(tmp_path: Path) -> None:
    result = xar("--believed-layout", str(tmp_path / "nowhere.txt"))
    assert (result.exit_code, result.stdout) == (2, "")
    assert "nowhere.txt cannot be read" in result.stderr
    assert result.stderr.count("\n") == 1


def test_sentences_stand_under_the_table_in_english_unless_japanese_is_wished(other_door: Path) -> None:
    english = xar("--believed-layout", str(other_door)).stdout
    assert english == xar("--believed-layout", str(other_door), "--language", "en").stdout
    table, _, rest = english.partition("○ At step 7, pick up the key directly ahead.")
    assert "importance" in table
    assert [line.rstrip() for line in rest.splitlines()[1:3]] == [
        "★ At step 16, go forward, out of the doorway.",
        "● At step 20, go forward, onto the goal.",
    ]
    japanese = xar("--believed-layout", str(other_door), "--language", "ja").stdout
    assert "★ ステップ16では、前に進んで、戸口から出る。" in japanese
    assert "At step" not in japanese


def test_the_json_object_is_the_same_in_every_language() -> None:
    assert explained("--language", "ja") == explained("--language", "en") == explained()


def test_the_languages_that_can_be_chosen_are_those_that_have_phrases() -> None:
    result = xar("--language", "tlh")
    assert result.exit_code == 2
    assert set(re.findall(r"'(\w+)'", result.stderr)) == {"tlh", *LANGUAGES}


def test_a_terminal_without_the_letters_of_a_language_is_told_so() -> None:
    asked = ["explain", "--layout", str(SIMULATION), "--language", "ja"]
    result = CliRunner(charset="ascii").invoke(main, asked)
    assert (result.exit_code, result.stdout) == (2, "")
    wish = "set PYTHONIOENCODING=utf-8, or choose another --language"
    assert result.stderr == f"xar: 'ja' cannot be written in this terminal's ascii; {wish}\n"
    assert CliRunner(charset="ascii").invoke(main, [*asked[:-1], "en"]).exit_code == 0


@pytest.mark.parametrize("mistaken", [False, True])
def test_the_exact_world_is_explained_within_two_seconds_and_without_torch(other_door: Path, mistaken: bool) -> None:
    belief = ["--believed-layout", str(other_door)] if mistaken else []
    program = (
        "import sys\n"
        "from webapp.cli import main\n"
        f"try:\n    main(['explain', '--layout', {str(SIMULATION)!r}, '--json', *{belief!r}])\n"
        "finally:\n"
        "    heavy = {'torch', 'scipy', 'minigrid', 'gymnasium', 'flask'}\n"
        "    print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
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
    marked, plain = explained(layout=layout), explained()
    assert marked.pop("about")["layout"] == plain.pop("about")["layout"]
    assert marked == plain
