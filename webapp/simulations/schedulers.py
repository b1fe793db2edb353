"""Where units of work run: in processes of this machine (loky), or on an existing Dask cluster.

A unit is a stack of fixed shape, so where it runs, beside what, and how often it is begun anew changes no row.
"""

import re
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError

Unit = tuple[Any, ...]
"""The arguments of one call of the work, all of which can be pickled."""


class SchedulerError(RuntimeError):
    """The scheduler cannot be used, or cannot go on; the message says what to do."""


@dataclass(frozen=True, slots=True)
class Scheduler:
    """Where to run.

    Attributes:
        address: `tcp://host:port` of a Dask scheduler; None for processes of this machine.
        workers: How many processes of this machine; a Dask cluster has its own.
    """

    address: str | None = None
    workers: int = 1

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"the number of workers must be 1 or larger, not {self.workers}")

    def __str__(self) -> str:
        return f"loky, {self.workers} worker{'' if self.workers == 1 else 's'}" if self.address is None else "dask"


def parse_scheduler(text: str, workers: int) -> Scheduler:
    """Read `loky` or `dask://host:port`.

    Raises:
        ValueError: It is neither.
    """
    if text == "loky":
        return Scheduler(None, workers)
    found = re.fullmatch(r"dask://(?P<host>[A-Za-z0-9.\-]+|\[[0-9A-Fa-f:]+\]):(?P<port>[0-9]{1,5})", text)
    if found is None:
        raise ValueError(f"--scheduler must be loky or dask://host:port, not {text!r}")
    return Scheduler(f"tcp://{found['host']}:{found['port']}", workers)


def work_off(
    scheduler: Scheduler, work: Callable[..., Any], todo: Sequence[tuple[int, Unit]]
) -> Iterator[tuple[int, Any]]:
    """Run units and yield the number and the result of each as soon as it is done, in whatever order.

    A worker that dies takes nothing with it but the units it was at; these are begun anew elsewhere.

    Args:
        scheduler: Where to run.
        work: A function that can be imported where it runs.
        todo: The units with their numbers.

    Raises:
        SchedulerError: There is no such cluster, or workers keep dying.
    """
    left = dict(todo)
    deaths = 0
    with _backend(scheduler):
        while left:
            try:
                tasks = [delayed(_numbered)(work, number, unit) for number, unit in left.items()]
                for number, result in Parallel(return_as="generator_unordered")(tasks):
                    del left[number]
                    deaths = 0
                    yield number, result
            except _DEATHS as death:
                deaths += 1
                if deaths == _MOST_DEATHS:
                    raise SchedulerError(
                        f"workers died {deaths} times with nothing done in between, perhaps for want of memory; use "
                        "fewer workers. What was done is kept."
                    ) from death


def _numbered(work: Callable[..., Any], number: int, unit: Unit) -> tuple[int, Any]:
    return number, work(*unit)


@contextmanager
def _backend(scheduler: Scheduler) -> Iterator[None]:
    with ExitStack() as stack:
        if scheduler.address is None:
            if scheduler.workers > 1:
                # Idle workers would leave by themselves some minutes later, perhaps just when they are wanted again.
                stack.callback(_end_workers)
            stack.enter_context(parallel_config("loky", n_jobs=scheduler.workers, inner_max_num_threads=1))
        else:
            stack.enter_context(_connected(scheduler.address))
            stack.enter_context(parallel_config("dask", wait_for_workers_timeout=_PATIENCE_S))
        yield


def _end_workers() -> None:
    get_reusable_executor(reuse=True).shutdown(wait=True, kill_workers=True)


@contextmanager
def _connected(address: str) -> Iterator[None]:
    """Be the client of a cluster."""
    try:
        from distributed import Client  # noqa: PLC0415 - an extra.
    except ImportError as error:
        raise SchedulerError("a Dask cluster needs the extra: pip install 'xar[dask]'") from error
    if not _speaks_first(address):
        raise SchedulerError(f"no Dask scheduler answers at {address}; start one, or use --scheduler loky")
    try:
        client: Any = Client(address, timeout=_PATIENCE_S, set_as_default=True)  # type: ignore[no-untyped-call]  # It has no types.
    except OSError as error:
        raise SchedulerError(f"the Dask scheduler at {address} does not answer as it should; start it anew") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE_S)
        except TimeoutError as error:
            raise SchedulerError(f"the Dask cluster at {address} has no workers; start some: dask worker") from error
        yield


def _speaks_first(address: str) -> bool:
    """Say whether somebody listens who greets a caller, as a Dask scheduler does. Its client would wait for ever."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=_PATIENCE_S) as caller:
            return bool(caller.recv(1))
    except (OSError, OverflowError):  # The latter for a port beyond 65535.
        return False


_PATIENCE_S = 10
_MOST_DEATHS = 3
_DEATHS = (TerminatedWorkerError,)
