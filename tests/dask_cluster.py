"""A real Dask cluster on this machine: a scheduler and workers, each a process of its own that can be killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

_PATIENCE_S = 60.0


@dataclass(frozen=True)
class DaskCluster:
    """A running cluster.

    Attributes:
        address: `host:port` of its scheduler.
        workers: Its worker processes. None is started anew when it dies: there is no nanny.
    """

    address: str
    workers: tuple[subprocess.Popen[bytes], ...]

    def kill_one(self) -> None:
        """Kill a worker as a crash or the want of memory would."""
        os.kill(self.workers[0].pid, signal.SIGKILL)


@contextmanager
def dask_cluster(num_workers: int = 2) -> Iterator[DaskCluster]:
    """Start a cluster on the loopback address, and end it."""
    port = _free_port()
    address = f"127.0.0.1:{port}"
    module = [sys.executable, "-m"]
    with ExitStack() as stack:
        start = [*module, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port)]
        stack.enter_context(_running([*start, "--no-dashboard", "--no-show"]))
        _wait_for(port)
        work = [*module, "distributed.cli.dask_worker", f"tcp://{address}", "--no-nanny", "--nthreads", "1"]
        work += ["--host", "127.0.0.1", "--no-dashboard", "--memory-limit", "0"]
        workers = tuple(stack.enter_context(_running(work)) for _ in range(num_workers))
        yield DaskCluster(address, workers)


@contextmanager
def _running(command: list[str]) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def _wait_for(port: int) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline:
        with socket.socket() as caller:
            if caller.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(f"no Dask scheduler listens at port {port} after {_PATIENCE_S:.0f} s")
