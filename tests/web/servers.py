"""The real server, `xar serve`, in a process of its own."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

_MUTANT = os.environ.get("XAR_TEST_MUTANT")
"""Which of `tests.faults.mutants` runs in place of the program, where a control of tests in the browser wants one."""

XAR = (
    (sys.executable, "-c", "from webapp.cli import main; main(prog_name='xar')")
    if _MUTANT is None
    else (sys.executable, "-m", "tests.faults.mutants", _MUTANT)
)


def environment(instance: Path, **settings: str) -> Mapping[str, str]:
    cleaned = {name: value for name, value in os.environ.items() if not name.startswith("XAR_")}
    return cleaned | {"XAR_INSTANCE": str(instance)} | settings


def run(instance: Path, *words: str, entered: str = "", **settings: str) -> subprocess.CompletedProcess[str]:
    """Run `xar` to its end."""
    return subprocess.run(
        [*XAR, *words],
        env=environment(instance, **settings),
        input=entered,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


class Server:
    """A running server.

    Attributes:
        lines: What it printed before it served.
        port: Where it listens.
    """

    def __init__(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        self.process = process
        self.lines = [process.stdout.readline().rstrip() for _ in range(3)]
        found = re.search(r":(\d+)/$", self.lines[0])
        assert found is not None, self.lines
        self.port = int(found[1])

    def stop(self, number: signal.Signals = signal.SIGTERM) -> tuple[int, str]:
        """Tell the server to stop; return its exit status and what else it printed."""
        self.process.send_signal(number)
        out, _ = self.process.communicate(timeout=60)
        return self.process.returncode, out


@contextmanager
def serving(instance: Path, *words: str, **settings: str) -> Iterator[Server]:
    """Run `xar serve` on a free port, for as long as the context lasts."""
    with subprocess.Popen(
        [*XAR, "serve", "--port", "0", *words],
        env=environment(instance, **settings),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            yield Server(process)
        finally:
            process.kill()
