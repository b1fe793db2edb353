"""Run tests again and again, each time in a process of its own that has imported other people's packages already.

    python -m tests.faults.forked_tests

Each line of the input is JSON: the arguments of pytest and a limit in seconds. Each line of the output answers one:
pytest's exit status, or null if the limit was reached, and the seconds it took.
"""

import importlib
import json
import os
import signal
import sys
import time

_PACKAGES = ("alembic.command", "argon2", "flask", "minigrid", "numpy", "pandas", "PIL.Image", "pydantic")
_MORE = ("pytest", "scipy.sparse", "sqlalchemy", "waitress", "click", "babel.dates", "psycopg")


def main() -> None:
    """Answer until the input ends."""
    for name in (*_PACKAGES, *_MORE):
        importlib.import_module(name)
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        arguments, limit_s = json.loads(line)
        began = time.monotonic()
        status = _run(arguments, limit_s)
        print(json.dumps([status, round(time.monotonic() - began, 2)]), file=answers, flush=True)


def _run(arguments: list[str], limit_s: float) -> int | None:
    child = os.fork()
    if child == 0:
        _test(arguments)
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _test(arguments: list[str]) -> None:
    """Run pytest and end this process, whatever happens."""
    status = 3
    try:
        os.setsid()
        silence = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silence, stream)
        status = int(importlib.import_module("pytest").main(arguments))
    finally:
        os._exit(status)


if __name__ == "__main__":
    main()
