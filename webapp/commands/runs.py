"""What the verbs that leave a run behind share: its name, its folder, how it is interrupted, and what is refused."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from webapp.command_line import CommandError

if TYPE_CHECKING:
    from webapp.runs.run_folders import RunFolder

_INTERRUPTED = 130
"""The exit status of a program that Ctrl-C ended."""

Finish = Callable[[Mapping[str, bytes], Mapping[str, object]], None]
"""What completes a run: it takes its files, and what else shall stand in `run.json`."""


def run_name_of(beginning: str, known: Mapping[str, object]) -> str:
    """Return the name of a run that follows from its settings."""
    digest = hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()
    return f"{beginning}-{digest[:8]}"


@contextmanager
def opened_run(kind: str, name: str, known: Mapping[str, object], out: Path) -> Iterator[tuple["RunFolder", Finish]]:
    """Open a run's folder in the folder of its kind.

    Args:
        kind: Where among the results, such as `power`.
        name: The run's name.
        known: All that its rows depend on beside the code.
        out: The folder of results.

    Yields:
        The folder, and what finishes it.

    Raises:
        RunFolderError: The name or the folder cannot be used.
    """
    from webapp.runs import provenance
    from webapp.runs.run_folders import check_run_name, open_run

    begun = datetime.now(UTC)
    path, settings = out / kind / check_run_name(name), {**known, "code": provenance.code_fingerprint()}
    with _terminated_like_ctrl_c(), open_run(path, settings) as folder:

        def finish(files: Mapping[str, bytes], more: Mapping[str, object]) -> None:
            now = datetime.now(UTC)
            about = {
                "command": provenance.command_line(),
                "commit": provenance.commit(),
                "finished_at": now.isoformat(timespec="seconds"),
                "seconds_of_last_session": round((now - begun).total_seconds(), 1),
                "versions": provenance.versions(),
                "machine": provenance.machine(),
                **({"rows_made_by": folder.all_makers} if folder.makers else {}),
                **more,
            }
            for place in {(folder.path / name).parent for name in files}:
                place.mkdir(parents=True, exist_ok=True)
            folder.complete(files, about)

        with _stopped_in_one_line(lambda: _kept(folder)):
            yield folder, finish


def complete_run(kind: str, name: str, known: Mapping[str, object], out: Path) -> Path | None:
    """Return the folder of a run if the complete run with exactly these settings and this code is there.

    Args:
        kind: As in `opened_run`, like the next three.
        name: The run's name.
        known: All that its rows depend on beside the code.
        out: The folder of results.

    Raises:
        RunFolderError: The name cannot be used.
    """
    from webapp.runs import provenance
    from webapp.runs.run_folders import check_run_name

    path = out / kind / check_run_name(name)
    try:
        settings = json.loads((path / "settings.json").read_bytes())
    except (OSError, ValueError):
        return None
    wanted = json.loads(json.dumps({**known, "code": provenance.code_fingerprint()}))
    return path if settings == wanted and (path / "run.json").exists() else None


@contextmanager
def stoppable(*folders: Path) -> Iterator[None]:
    """End what Ctrl-C or SIGTERM interrupts in one line, with the exit status 130 and nothing left.

    Args:
        folders: That may be made meanwhile, the inner ones first; those that were not there before are gone afterwards,
            the first one with all that is in it and the others if they are empty.
    """
    made = [folder for folder in folders if not folder.exists()]

    def clear() -> str:
        if made and made[0] == folders[0]:
            shutil.rmtree(made[0], ignore_errors=True)
        for folder in made:
            with suppress(OSError):
                folder.rmdir()
        return "Nothing was written."

    with _terminated_like_ctrl_c(), _stopped_in_one_line(clear):
        yield


@contextmanager
def _stopped_in_one_line(end: Callable[[], str]) -> Iterator[None]:
    """Tell in a line that something was stopped, and what becomes of it."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"\nStopped. {end()}", err=True)
        raise click.exceptions.Exit(_INTERRUPTED) from None


def _kept(folder: "RunFolder") -> str:
    if not folder.finished:
        return "Nothing was done yet."
    return f"What is done is kept in {folder.path}; the same command goes on from there."


@contextmanager
def _terminated_like_ctrl_c() -> Iterator[None]:
    """End a run that is told to terminate as Ctrl-C ends it, its workers and its server included."""
    import signal

    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def run_refusals() -> Iterator[None]:
    """Turn what is refused into one line and exit status 2."""
    from webapp.commands.studying import study_refusals
    from webapp.runs.run_folders import RunFolderError
    from webapp.study.problems import StudyError

    with study_refusals():
        try:
            yield
        except StudyError:
            raise
        except (OSError, RunFolderError, ValueError) as error:
            raise CommandError(str(error)) from error
