"""The real server, in processes that can be killed and started again on the same port."""

import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.web.servers import XAR, environment

_STARTS_WITHIN_S = 30.0


class Program:
    """A server that comes back on the same port.

    Attributes:
        port: Where it listens, on this machine.
        log: What it says.
        num_kills: How often it, or a part of it, was killed.
    """

    def __init__(self, instance: Path, mutant: str | None = None, prefix: Sequence[str] = (), **settings: str) -> None:
        """Get ready to start.

        Args:
            instance: Its folder.
            mutant: Which of `mutants` to run in its place.
            prefix: What stands before the command and becomes the program.
            settings: More environment variables.
        """
        self.port = free_port()
        self.log = instance.with_name(f"{instance.name}.log")
        self.num_kills = 0
        program: Sequence[str] = XAR if mutant is None else (sys.executable, "-m", "tests.faults.mutants", mutant)
        self._command: list[str | Path] = [*prefix, *program, "serve", "--port", str(self.port)]
        self._environment = environment(instance, **settings)
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start, and return as soon as it listens."""
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                self._command,
                env=self._environment,
                cwd=Path(__file__).parents[2],
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        ends_at = time.monotonic() + _STARTS_WITHIN_S
        while not listens(self.port):
            assert self._process.poll() is None, self.log.read_text(encoding="utf-8")[-2000:]
            assert time.monotonic() < ends_at, f"the server did not start within {_STARTS_WITHIN_S} s"
            time.sleep(0.02)

    def restart(self) -> None:
        """Stop it as one does, and start it again."""
        self.stop()
        self.start()

    def reload(self) -> None:
        """Let gunicorn replace its workers one after the other, as after an update, and return when it has."""
        before = set(self.workers())
        os.kill(self.pid, signal.SIGHUP)
        ends_at = time.monotonic() + _STARTS_WITHIN_S
        while before & set(self.workers()):
            assert time.monotonic() < ends_at, f"the workers were not replaced within {_STARTS_WITHIN_S} s"
            time.sleep(0.05)

    @property
    def pid(self) -> int:
        """Its process."""
        assert self._process is not None
        return self._process.pid

    def kill(self) -> None:
        """Kill it with everything that belongs to it; nothing of it can react."""
        assert self._process is not None
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self.num_kills += 1

    def kill_worker(self, rng: random.Random) -> None:
        """Kill one of its worker processes, or all of it where it has none."""
        workers = self.workers()
        if workers:
            os.kill(int(rng.choice(workers)), signal.SIGKILL)
            self.num_kills += 1
        else:
            self.kill()
            self.start()

    def workers(self) -> list[str]:
        """Return the processes that it has started."""
        return Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text(encoding="ascii").split()

    def stop(self) -> None:
        """Stop it as one does."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()


@contextmanager
def running(
    instance: Path, mutant: str | None = None, prefix: Sequence[str] = (), **settings: str
) -> Iterator[Program]:
    """Run the server for as long as the context lasts."""
    program = Program(instance, mutant, prefix, **settings)
    program.start()
    try:
        yield program
    finally:
        program.stop()


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


def listens(port: int) -> bool:
    """Tell whether somebody listens on a port."""
    with socket.socket() as tried:
        return tried.connect_ex(("127.0.0.1", port)) == 0


def in_threads(actions: Sequence[threading.Thread]) -> None:
    """Run threads to their end."""
    for action in actions:
        action.start()
    for action in actions:
        action.join()
