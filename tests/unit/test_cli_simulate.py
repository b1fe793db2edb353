"""`xar simulate`, as people at a terminal use it: begun, stopped, taken up again, spread over a cluster, refused."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.conftest import XAR
from tests.dask_cluster import dask_cluster
from webapp.cli import main

SWEEP = ("count", "--quick", "--runs", "3", "--episodes", "25")
UNCOMPARED = {"run.json"}


def xar(*arguments: str, out: Path, columns: int = 100) -> Result:
    environment = {"COLUMNS": str(columns), "XAR_INSTANCE": str(out / "instance")}
    return CliRunner().invoke(main, ["simulate", *arguments, "--out", str(out)], env=environment)


def only_run(out: Path) -> Path:
    (folder,) = (out / "simulations" / "count").iterdir()
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.name not in UNCOMPARED}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A quick run by one process, and what it printed."""
    out = tmp_path_factory.mktemp("results")
    return out, xar(*SWEEP, "--workers", "1", out=out, columns=140)


@pytest.fixture
def started(tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """The same as a program of its own with two workers, whose first stack is done."""
    command = [str(XAR), "simulate", *SWEEP, "--workers", "2", "--out", str(tmp_path)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        deadline = time.monotonic() + 120
        while process.poll() is None and time.monotonic() < deadline:
            journals = list(tmp_path.glob("simulations/count/*/journal.jsonl"))
            if journals and journals[0].read_text().count("\n"):
                break
            time.sleep(0.05)
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def test_a_run_says_what_is_claimed_and_where_everything_is(finished: tuple[Path, Result]) -> None:
    out, result = finished
    assert result.exit_code == 0, result.stderr
    folder = only_run(out)
    assert str(folder) in result.stdout.replace("\n", "")
    assert "2 and 3 subgoals: no difference" in result.stdout
    assert "3 runs per condition are too few to conclude anything." in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 140
    about = json.loads((folder / "run.json").read_text())
    assert set(about) >= {"command", "commit", "finished_at", "versions", "machine", "scheduler"}
    assert about["versions"]["torch"].startswith("2.")
    settings = json.loads((folder / "settings.json").read_text())
    assert settings["settings"]["num_runs"] == 3
    assert settings["settings"]["fresh"]["max_episodes"] == 25
    assert not (folder / "journal.jsonl").exists()


def test_a_complete_run_is_never_overwritten(finished: tuple[Path, Result]) -> None:
    out, _ = finished
    before = contents(only_run(out))
    result = xar(*SWEEP, out=out)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert "holds a complete run and is never overwritten; give another --run" in result.stderr
    assert contents(only_run(out)) == before


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_leaves_a_run_that_the_same_command_completes_to_the_same_bytes(
    started: "subprocess.Popen[str]", tmp_path: Path, finished: tuple[Path, Result], number: signal.Signals
) -> None:
    if number == signal.SIGINT:
        os.killpg(started.pid, number)  # As a terminal does: to the program and to its workers.
    else:
        started.send_signal(number)
    _, told = started.communicate(timeout=60)  # It ends only when no worker holds the pipe any more.
    folder = only_run(tmp_path)
    assert started.returncode == 130, told
    assert "is kept in" in told
    assert "the same command goes on from there" in " ".join(told.split())
    assert "Traceback" not in told
    assert not (folder / "run.json").exists()
    kept = len((folder / "journal.jsonl").read_text().splitlines())
    assert kept >= 1
    result = xar(*SWEEP, "--workers", "1", out=tmp_path)
    assert result.exit_code == 0, result.stderr
    assert contents(folder) == contents(only_run(finished[0]))


@pytest.mark.slow
def test_a_run_that_is_killed_outright_is_completed_to_the_same_bytes(
    started: "subprocess.Popen[str]", tmp_path: Path, finished: tuple[Path, Result]
) -> None:
    os.killpg(started.pid, signal.SIGKILL)
    started.communicate()
    result = xar(*SWEEP, "--workers", "1", out=tmp_path)
    assert result.exit_code == 0, result.stderr
    assert contents(only_run(tmp_path)) == contents(only_run(finished[0]))


@pytest.mark.slow
def test_a_dask_cluster_that_loses_a_worker_gives_the_bytes_of_one_process(
    tmp_path: Path, finished: tuple[Path, Result]
) -> None:
    with dask_cluster(num_workers=2) as cluster:
        command = [str(XAR), "simulate", *SWEEP, "--scheduler", f"dask://{cluster.address}", "--out", str(tmp_path)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        _wait_for_a_stack(tmp_path, process)
        assert process.poll() is None, "the run was over before a worker could be killed"
        cluster.kill_one()
        _, told = process.communicate(timeout=240)
        assert cluster.workers[0].poll() == -signal.SIGKILL
    assert process.returncode == 0, told
    assert contents(only_run(tmp_path)) == contents(only_run(finished[0]))


def _wait_for_a_stack(out: Path, process: "subprocess.Popen[str]") -> None:
    deadline = time.monotonic() + 120
    while process.poll() is None and time.monotonic() < deadline:
        if any(path.read_text().count("\n") for path in out.glob("simulations/count/*/journal.jsonl")):
            return
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("usefulness", "--runs", "1"), "1 is not in the range"),
        (("usefulness", "--scheduler", "slurm"), "--scheduler must be loky or dask://host:port, not 'slurm'"),
        (("count", "--scheduler", "dask://127.0.0.1:9", "--quick"), "no Dask scheduler answers at tcp://127.0.0.1:9"),
        (("count", "--layout", "nowhere.txt"), "nowhere.txt cannot be read: No such file or directory"),
        (("count", "--quick", "--run", "../up"), "a run is named by up to 80 letters"),
        (("count", "--seed", "-1"), "-1 is not in the range"),
        (("nothing",), "No such command 'nothing'"),
        (("count", "--quick", "--settings", "ours"), "--quick has settings of its own; leave --settings out"),
        (("count", "--quick", "--run", ""), "a run is named by up to 80 letters"),
    ],
)
def test_a_mistake_is_one_line_and_exit_status_2(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    result = xar(*arguments, out=tmp_path)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.strip().count("\n") == 0


def test_a_map_without_subgoals_is_refused_before_a_folder_is_made(tmp_path: Path) -> None:
    layout = tmp_path / "corridor.txt"
    layout.write_text("######\n#>KDG#\n######\n")
    result = xar("usefulness", "--layout", str(layout), out=tmp_path / "out")
    assert result.exit_code == 2
    assert "corridor has no subgoal beside the goal" in result.stderr
    assert not (tmp_path / "out").exists()
