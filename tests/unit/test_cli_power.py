"""`xar power`, what `xar study check` tells of it, and `xar rehearse --calibrate`, as people at a terminal use them."""

import json
import signal
from pathlib import Path

import click
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from webapp.cli import main
from webapp.commands.runs import opened_run
from webapp.stimuli.new_study import write_study

FEW = ("--studies", "4", "--participants", "20,10", "--effects", "0.8,0.5", "--workers", "1")
TABLES = {"power.csv", "required.csv", "summary.md", "power.svg", "power.png"}


def xar(home: Path, *words: str) -> Result:
    return CliRunner().invoke(main, words, env={"COLUMNS": "100", "XAR_INSTANCE": str(home / "instance")})


def power(home: Path, *words: str) -> Result:
    return xar(home, "power", *words, "--out", str(home / "results"))


def runs(home: Path, kind: str = "power") -> list[Path]:
    return sorted((home / "results" / kind).iterdir())


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    home = tmp_path_factory.mktemp("home")
    return home, power(home, *FEW)


def test_a_run_tells_what_is_needed_and_where_everything_is(finished: tuple[Path, Result]) -> None:
    home, result = finished
    assert result.exit_code == 0, result.stderr
    (folder,) = runs(home)
    assert {file.name for file in folder.iterdir()} == TABLES | {"settings.json", "run.json"}
    assert "1: subgoals \N{MINUS SIGN} random" in result.stdout
    assert "Required participants:" in result.stdout
    assert str(folder) in result.stdout.replace("\n", "")
    table = pd.read_csv(folder / "power.csv", dtype={"experiment": str})
    assert set(table["effect"]) == {0.0, 0.5, 0.8}
    assert set(table["participants"]) == {10, 20}
    summary = (folder / "summary.md").read_text(encoding="utf-8")
    for said in ("Holm's correction of 9 tests", "standard deviation of 0.6", "4 studies of 10 to 20 participants"):
        assert said in summary
    assert json.loads((folder / "settings.json").read_text())["settings"]["seed"] == 2021


def test_the_same_command_tells_the_complete_run_again_and_writes_nothing(finished: tuple[Path, Result]) -> None:
    home, result = finished
    (folder,) = runs(home)
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    again = power(home, *FEW)
    assert again.exit_code == 0, again.stderr
    told, _, tables = again.stdout.partition("\n\n")
    assert told == "The complete run of these settings is there already, and this is what it found."
    assert tables == result.stdout
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before


def test_a_run_of_other_settings_is_never_overwritten(finished: tuple[Path, Result]) -> None:
    home, _ = finished
    (folder,) = runs(home)
    other = power(home, *FEW, "--seed", "5", "--run", folder.name)
    assert other.exit_code == 2
    assert "is never overwritten; give another --run" in other.stderr


def test_a_complete_run_whose_tables_were_changed_is_refused_in_one_line(tmp_path: Path) -> None:
    assert power(tmp_path, *FEW).exit_code == 0
    (folder,) = runs(tmp_path)
    (folder / "required.csv").write_text("experiment,items\n1,general\n", encoding="utf-8")
    again = power(tmp_path, *FEW)
    assert again.exit_code == 2
    assert again.stderr.endswith("were changed after the run; give another --run\n")
    assert again.stderr.count("\n") == 1


def test_more_workers_give_the_same_bytes(finished: tuple[Path, Result]) -> None:
    home, _ = finished
    result = power(home, *FEW[:-1], "2", "--run", "two-workers")
    assert result.exit_code == 0, result.stderr
    first, second = runs(home)
    for name in TABLES:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_a_check_tells_what_is_needed_until_the_plan_changes(tmp_path: Path) -> None:
    study = write_study("mine", "sakai2021", tmp_path)
    assert "run `xar power STUDY`" in xar(tmp_path, "study", "check", str(study)).stdout
    assert power(tmp_path, str(study), *FEW).exit_code == 0
    told = " ".join(xar(tmp_path, "study", "check", str(study)).stdout.split())
    assert "for d = .8 (power .8; xar power, 4 simulated studies)." in told
    found = json.loads(xar(tmp_path, "study", "check", str(study), "--json").stdout)["required_participants"]
    assert [sample["effect"] for sample in found["samples"]] == [0.5, 0.8]
    texts = study / "texts" / "en.toml"
    texts.write_text(texts.read_text(encoding="utf-8").replace("the agent", "the robot"), encoding="utf-8")
    assert "xar power, 4 simulated studies" in " ".join(xar(tmp_path, "study", "check", str(study)).stdout.split())
    file = study / "study.toml"
    file.write_text(
        file.read_text().replace('first = "subgoals", second = "full"', 'first = "random", second = "full"')
    )
    assert "run `xar power STUDY`" in xar(tmp_path, "study", "check", str(study)).stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nowhere",), "there is no study 'nowhere'"),
        (("--effects", "small"), "'--effects': 'small' is no list of numbers; write such as 0.3,0.5,0.8"),
        (("--participants", "a"), "'--participants': 'a' is no list of numbers; write such as 10,20,40"),
        (("--effects", "0"), "effects must lie from 0.01 to 5, not at 0"),
        (("--participants", "1,5"), "participants must lie from 2"),
        (("--studies", "1"), "'--studies': 1 is not in the range x>=2"),
        (("--seed", "-1"), "'--seed': -1 is not in the range x>=0"),
        (("--sd", "1"), "from 0 to below 1, not 1"),
        (("--power", "1.5"), "the power must lie between 0 and 1"),
        (("--run", "no/such"), "a run is named by"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_one_line(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    result = power(tmp_path, *words)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(("units", "said"), [(0, "Nothing was done yet."), (1, "the same command goes on from there.")])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_told_to_stop_says_what_is_kept(
    units: int, said: str, number: signal.Signals, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run() -> None:
        with opened_run("power", "mine", {}, tmp_path) as (folder, _):
            for unit in range(units):
                folder.keep(unit, [], {})
            signal.raise_signal(number)

    with pytest.raises(click.exceptions.Exit) as stopped:
        run()
    assert stopped.value.exit_code == 130
    assert said in capsys.readouterr().err
    with opened_run("power", "mine", {}, tmp_path) as (folder, finish):
        assert len(folder.finished) == units
        finish({}, {})


def test_a_calibration_tells_what_is_promised_and_writes_every_test(tmp_path: Path) -> None:
    words = ("rehearse", "--calibrate", "12", "--participants", "30", "--seed", "4", "--out", str(tmp_path / "results"))
    result = xar(tmp_path, *words)
    assert result.exit_code == 0, result.stdout + result.stderr
    assert "Every promise is kept." in result.stdout
    (folder,) = runs(tmp_path, "rehearsal")
    assert len(pd.read_csv(folder / "tests.csv")) == 2 * 12 * 9
    assert not (tmp_path / "instance").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--effect", "subgoal=1"), "did you mean 'subgoals'?"),
        (("--mix", "asleep=1"), "--mix names 'asleep'"),
        (("--calibrate", "1"), "1 is not in the range"),
    ],
)
def test_what_cannot_be_rehearsed_is_refused_in_one_line(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    result = xar(tmp_path, "rehearse", *words, "--out", str(tmp_path / "results"))
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "results").exists()
