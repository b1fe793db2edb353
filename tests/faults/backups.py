"""Backups while people answer (F16): each holds a prefix of what was acknowledged, and people go on from it.

    python -m tests.faults.backups [--full]

A process of its own lets people take part and notes each page whose storing was confirmed. Meanwhile `xar backup` runs
again and again. The control copies the file in the way of `cp`, and must be refused.
"""

import argparse
import os
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from tests.faults.oracle import bound, evidence
from tests.unit.storage.people import enrol_somebody, send, walk
from tests.web.servers import run
from webapp.storage.backup_manifests import complete_backups, read_manifest, write_manifest
from webapp.storage.database import Database, open_database
from webapp.storage.participants import find_participant
from webapp.storage.restoring import restore, verify
from webapp.storage.verification import verify_log
from webapp.views.services import utc_now

NUM_WRITERS = 3
LAST_PAGE = 11
_BEGIN_PAGES = 5
_WAIT_S = 60.0


@contextmanager
def writing(database: Path, ledger: Path) -> Iterator[Callable[[], None]]:
    """Let people take part in a process of its own, for as long as the context lasts.

    Args:
        database: The file, with its tables.
        ledger: Where confirmed pages are noted, a line for each: the participant's code and the page.

    Yields:
        A function that waits until a few more pages were confirmed than when it was called.
    """
    command = [sys.executable, "-m", "tests.faults.backups", "--write", str(database), "--ledger", str(ledger)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:

        def wait() -> None:
            before, began = len(acknowledged(ledger)), time.monotonic()
            while len(acknowledged(ledger)) < before + _BEGIN_PAGES:
                assert process.poll() is None, "the writers ended"
                assert time.monotonic() - began < _WAIT_S, "nothing was written"
                time.sleep(0.01)

        try:
            yield wait
        finally:
            process.communicate()
    assert process.returncode == 0


def acknowledged(ledger: Path) -> set[str]:
    """Return the pages that were confirmed by now."""
    return set(ledger.read_text(encoding="ascii").split("\n")[:-1]) if ledger.exists() else set()


def stored(database: Path) -> set[str]:
    """Return the pages that a database file holds, in the same form."""
    query = "SELECT p.code, g.number FROM pages g JOIN participants p ON p.id = g.participant_id"
    with closing(sqlite3.connect(database)) as connection:
        return {f"{code} {number}" for code, number in connection.execute(query)}


def chain(database: Path) -> dict[int, str]:
    """Return the hash of each record of a database file."""
    with closing(sqlite3.connect(database)) as connection:
        return dict(connection.execute("SELECT number, hash FROM records"))


def torn_copy(database: Path, copy: Path, wait: Callable[[], None]) -> None:
    """Copy a file as `cp` does that is held up half-way."""
    copy.parent.mkdir(parents=True, exist_ok=True)
    with database.open("rb") as source, copy.open("wb") as target:
        target.write(source.read(database.stat().st_size // 8192 * 4096))
        wait()
        target.write(source.read())


def write(database: Path, ledger: Path) -> None:
    """Let people take part until standard input ends."""
    is_over = threading.Event()
    lines = os.open(ledger, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def take_part() -> None:
        while not is_over.is_set():
            person = enrol_somebody(opened, "live", cookie=os.urandom(8).hex())
            for page in range(1, LAST_PAGE + 1):
                if is_over.is_set():
                    return
                assert send(opened, person, page) == "accept"
                os.write(lines, f"{person.code} {page}\n".encode())

    with closing(Database(database)) as opened:
        threads = [threading.Thread(target=take_part) for _ in range(NUM_WRITERS)]
        for thread in threads:
            thread.start()
        sys.stdin.read()
        is_over.set()
        for thread in threads:
            thread.join()
    os.close(lines)


def main() -> int:
    """Run the drill and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="100 backups and 20 controls, not 20 and 3")
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--ledger", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.write is not None:
        write(given.write, given.ledger)
        return 0
    num_backups, num_copies = (100, 20) if given.full else (20, 3)
    with tempfile.TemporaryDirectory() as folder:
        return _drill(Path(folder), num_backups, num_copies)


def _drill(folder: Path, num_backups: int, num_copies: int) -> int:
    instance, kept, ledger = folder / "instance", folder / "kept", folder / "ledger"
    database = instance / "xar.sqlite3"
    with open_database(database):
        pass
    known, copies = [], [kept / f"copy-{number}.sqlite3" for number in range(num_copies)]
    with writing(database, ledger) as wait:
        wait()
        for _ in range(num_backups):
            known.append(acknowledged(ledger))
            done = run(instance, "backup", "--to", str(kept))
            assert done.returncode == 0, done.stderr
        for copy in copies:
            torn_copy(database, copy, wait)
    backups, final = list(complete_backups(kept)), chain(database)
    problems = [line for path, _ in backups for line in verify(path, folder / "check")[1]]
    lost = sum(len(before - stored(path)) for before, (path, _) in zip(known, backups, strict=True))
    strangers = sum(final.get(manifest.head.number) != manifest.head.hash for _, manifest in backups)
    ghosts = sum(len(stored(path) - stored(database)) for path, _ in backups)
    refused = sum(bool(verify(copy, folder / "check")[1]) for copy in copies)
    # Even with a manifest of its own, a torn copy does not pass.
    for copy in copies:
        write_manifest(copy, read_manifest(backups[-1][0]))
    found_out = sum(bool(verify(copy, folder / "check")[1]) for copy in copies)
    num_resumed = _resume(backups[-1][0], folder / "restored" / "xar.sqlite3")
    num_sent = len(acknowledged(ledger))
    counts = {
        "backups": len(backups),
        "acknowledged at the end": num_sent,
        "problems": len(problems),
        "lost": lost,
        "not a prefix": strangers,
        "never sent": ghosts,
        "went on after the restore": num_resumed,
    }
    control = {"copied with cp": num_copies, "refused": refused, "refused with a manifest": found_out}
    print(evidence("backup while writing", counts, control=control, bound=bound(num_sent)))
    is_well = len(backups) == num_backups and not (problems or lost or strangers or ghosts)
    return 0 if is_well and num_resumed and refused == found_out == num_copies else 1


def _resume(backup: Path, database: Path) -> int:
    """Restore a backup, let everybody go on who had not finished, and return how many they were."""
    restore(backup, database, utc_now())
    with closing(sqlite3.connect(database)) as connection:
        tokens = [token for (token,) in connection.execute("SELECT token_hash FROM participants")]
    with closing(Database(database)) as opened:
        people = [person for token in tokens if (person := find_participant(opened, token)) is not None]
        unfinished = [person for person in people if person.num_stored < LAST_PAGE]
        for person in unfinished:
            for page in range(person.num_stored + 1, LAST_PAGE + 1):
                assert send(opened, person, page) == "accept"
        walk(opened, enrol_somebody(opened, "live", cookie="a newcomer"), LAST_PAGE)
        assert verify_log(opened).problems == ()
    return len(unfinished)


if __name__ == "__main__":
    sys.exit(main())
