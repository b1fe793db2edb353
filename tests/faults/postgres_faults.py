"""What may happen to workers of the web server, and to the PostgreSQL server that they share."""

import os
import random
import signal
import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass

import psycopg

from tests import postgres
from tests.faults.program import Program

NUM_WORKERS = 2
_PATIENCE_S = 30.0

OF_WEB = ("worker", "web_server")
OF_DATABASE = ("backend", "postmaster", "immediate")
KINDS = (*OF_WEB, *OF_DATABASE)


@dataclass
class Faults:
    """What may happen to a server with its workers, and to the database that they share."""

    program: Program
    server: postgres.Server
    rng: random.Random

    def worker(self) -> None:
        """Kill one worker, which gunicorn replaces."""
        before = self.program.workers()
        self.program.kill_worker(self.rng)
        self._await(lambda now: now != before)

    def all_workers(self) -> None:
        """Kill all workers at once; gunicorn replaces them."""
        before = set(self.program.workers())
        for process in before:
            os.kill(int(process), signal.SIGKILL)
        self._await(lambda now: len(now) == NUM_WORKERS and not before & set(now))

    def web_server(self) -> None:
        """Kill the whole web server and start it again."""
        self.program.kill()
        self.program.start()
        self._await(lambda now: len(now) == NUM_WORKERS)

    def _await(self, is_so: Callable[[list[str]], bool]) -> None:
        ends_at = time.monotonic() + _PATIENCE_S
        while not is_so(self.program.workers()):
            assert time.monotonic() < ends_at, f"the workers are {self.program.workers()} after {_PATIENCE_S} s"
            time.sleep(0.01)

    def backend(self) -> None:
        """Kill a process that works for the web server: all others are then ended too, and PostgreSQL recovers."""
        query = "SELECT pid FROM pg_stat_activity WHERE application_name = 'xar'"
        with closing(self.server.connect()) as witness:
            while not (found := witness.execute(query).fetchall()):
                time.sleep(0.01)  # The workers are just starting.
            os.kill(self.rng.choice(found)[0], signal.SIGKILL)
            with suppress(psycopg.OperationalError):
                while True:
                    witness.execute("SELECT pg_sleep(0.01)")

    def postmaster(self) -> None:
        """Kill the first process of the database and start it again after a moment."""
        self.server.kill()
        time.sleep(self.rng.uniform(0.0, 1.0))
        self.server.start(wait=False)

    def immediate(self) -> None:
        """Stop the database without letting it write anything down, and start it again after a moment."""
        self.server.stop("immediate")
        time.sleep(self.rng.uniform(0.0, 1.0))
        self.server.start(wait=False)
