"""Where units run: processes of this machine, and a real Dask cluster; workers may die."""

import http.server
import os
import signal
from pathlib import Path
from threading import Thread

import pytest

from tests.dask_cluster import dask_cluster
from webapp.simulations.schedulers import Scheduler, SchedulerError, parse_scheduler, work_off

UNITS = [(number, (number,)) for number in range(6)]
SQUARES = {number: number * number for number in range(6)}


def square(number: int) -> int:
    return number * number


def own_process(number: int) -> tuple[int, int]:
    return number, os.getpid()


def dying_once(number: int, marker: str) -> int:
    """Kill the worker at the third unit, the first time it is tried."""
    if number == 3:
        try:
            Path(marker).touch(exist_ok=False)
        except FileExistsError:
            return square(number)
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def dying_always(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def failing(number: int) -> int:
    raise ValueError(f"unit {number} cannot be done")


@pytest.mark.parametrize("workers", [1, 2])
def test_every_unit_is_done_once_whatever_the_number_of_workers(workers: int) -> None:
    done = list(work_off(Scheduler(workers=workers), square, UNITS))
    assert dict(done) == SQUARES
    assert len(done) == len(UNITS)


def test_no_worker_stays_behind_idle() -> None:
    processes = {process for _, (_, process) in work_off(Scheduler(workers=2), own_process, UNITS)}
    assert os.getpid() not in processes
    for process in processes:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_nothing_to_do_needs_no_worker() -> None:
    assert list(work_off(Scheduler(workers=2), square, [])) == []


def test_a_worker_that_dies_takes_no_unit_with_it(tmp_path: Path) -> None:
    units = [(number, (number, str(tmp_path / "died"))) for number in range(6)]
    done = list(work_off(Scheduler(workers=2), dying_once, units))
    assert (tmp_path / "died").exists()
    assert dict(done) == SQUARES
    assert len(done) == len(UNITS)


def test_workers_that_always_die_are_given_up(tmp_path: Path) -> None:
    del tmp_path
    with pytest.raises(SchedulerError, match="workers died 3 times with nothing done in between"):
        list(work_off(Scheduler(workers=2), dying_always, UNITS))


def test_an_error_of_the_work_itself_is_not_tried_again() -> None:
    with pytest.raises(ValueError, match=r"unit \d cannot be done"):
        list(work_off(Scheduler(workers=2), failing, UNITS))


def test_a_killed_worker_of_a_dask_cluster_takes_no_unit_with_it() -> None:
    with dask_cluster(num_workers=2) as cluster:
        done = []
        for number, result in work_off(parse_scheduler(f"dask://{cluster.address}", 1), square_slowly, UNITS):
            done.append((number, result))
            if len(done) == 1:
                cluster.kill_one()
        assert cluster.workers[0].wait(timeout=30) == -signal.SIGKILL
    assert dict(done) == SQUARES
    assert len(done) == len(UNITS)


def square_slowly(number: int) -> int:
    import time  # noqa: PLC0415 - it travels to the worker with the function.

    time.sleep(0.5)
    return number * number


@pytest.mark.parametrize("port", [9, 99_999])
def test_a_cluster_that_is_not_there_is_named(port: int) -> None:
    with pytest.raises(SchedulerError, match=rf"no Dask scheduler answers at tcp://127\.0\.0\.1:{port}; start one"):
        list(work_off(parse_scheduler(f"dask://127.0.0.1:{port}", 1), square, UNITS))


def test_a_cluster_without_workers_is_named() -> None:
    with dask_cluster(num_workers=0) as cluster, pytest.raises(SchedulerError, match="has no workers; start some"):
        list(work_off(parse_scheduler(f"dask://{cluster.address}", 1), square, UNITS))


class Silent(http.server.BaseHTTPRequestHandler):
    """A server that has nothing to do with Dask and keeps it to itself."""

    def log_message(self, *args: object) -> None:
        """Say nothing."""


def test_something_else_at_the_address_is_no_cluster() -> None:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Silent) as other:
        Thread(target=other.serve_forever, daemon=True).start()
        with pytest.raises(SchedulerError, match="no Dask scheduler answers at"):
            list(work_off(parse_scheduler(f"dask://127.0.0.1:{other.server_port}", 1), square, UNITS))
        other.shutdown()


@pytest.mark.parametrize(
    "text", ["", "dask", "dask://", "dask://host", "dask://host:", "tcp://host:1", "slurm", "dask://a b:1"]
)
def test_what_is_no_scheduler_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"--scheduler must be loky or dask://host:port, not "):
        parse_scheduler(text, 1)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("loky", None),
        ("dask://127.0.0.1:8786", "tcp://127.0.0.1:8786"),
        ("dask://node-3.lab:80", "tcp://node-3.lab:80"),
        ("dask://[::1]:8786", "tcp://[::1]:8786"),
    ],
)
def test_schedulers_are_read(text: str, address: str | None) -> None:
    assert parse_scheduler(text, 3) == Scheduler(address, 3)


def test_no_worker_is_too_few() -> None:
    with pytest.raises(ValueError, match="number of workers must be 1 or larger, not 0"):
        Scheduler(workers=0)
