"""Participants finished per second, beside oTree in the same run, and crowds of 500 and 1,000 at once.

python -m tests.benchmarks.throughput [--repetitions 3] [--people 400] [--at-once 200] [--postgres]

Both systems get the same people from the same generator (`load.generator`): everybody goes on as soon as a page is
there, reads the form from the page, and loads each picture once, but no style sheets and scripts. The systems take
turns, each time on a new database. oTree's session is made, with its rows and links, before its clock starts; our
participants are made when they consent. Afterwards the database of each is compared with what was acknowledged.

Both studies have the same pages: consent, instructions, three times a page with a picture and a page with three
ratings, the end. With `--postgres` each has two web processes and a database on the same PostgreSQL server; each of
oTree's processes has its own half of the people, ours take from one port.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests import postgres
from tests.benchmarks.load import ours
from tests.benchmarks.load.crowds import send
from tests.benchmarks.load.generator import Plan
from tests.benchmarks.load.judging import Judged, judge, medians
from tests.benchmarks.load.studies import build_load_study
from tests.benchmarks.peer_otree import (
    END,
    VERSION,
    NoPeerError,
    install_peer,
    serve_peer,
    stored_by_peer,
    told_to_peer,
)
from tests.faults.oracle import bound, evidence

HOST = "127.0.0.1"
CROWDS = (500, 1000)
NUM_PROCESSES = 2

_Run = Callable[[int, int, int], Judged]


@dataclass(frozen=True, slots=True)
class Edition:
    """With which database both programs are run.

    Attributes:
        name: What it is called.
        wanted_ratio: How many times as many people as oTree's have to finish in a second.
        num_processes: How many web processes each has.
        server: The PostgreSQL server; None for SQLite.
    """

    name: str = "SQLite"
    wanted_ratio: float = 4.0
    num_processes: int = 1
    server: postgres.Server | None = None

    @contextmanager
    def database(self, template: str) -> Iterator[str | None]:
        """Yield the address of a new database, with the tables of a template; None for SQLite."""
        if self.server is None:
            yield None
            return
        name = self.server.make(template=template)
        try:
            yield self.server.url(name)
        finally:
            self.server.drop(name)


@contextmanager
def _edition(*, is_postgres: bool) -> Iterator[Edition]:
    if not is_postgres:
        yield Edition()
        return
    with postgres.a_server(on_disk=True) as server:
        yield Edition("PostgreSQL", 2.0, NUM_PROCESSES, server)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the numbers as JSON; return 0 if nothing was lost and the ratio is reached."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--people", type=int, default=400)
    parser.add_argument("--at-once", type=int, default=200)
    parser.add_argument("--kind", default="none", help="what our trials show above the ratings")
    parser.add_argument("--postgres", action="store_true", help="the PostgreSQL editions, with two processes each")
    parser.add_argument("--no-peer", action="store_true", help="the crowds alone")
    parser.add_argument("--no-crowds", action="store_true", help="the comparison alone")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name, _edition(is_postgres=options.postgres) as edition:
        return _measure(edition, Path(name), options)


def _measure(edition: Edition, scratch: Path, options: argparse.Namespace) -> int:
    is_good = True
    built = build_load_study(scratch, options.kind)
    us = our_runs(built, scratch, edition)
    if not options.no_peer:
        try:
            is_good &= _compare(edition, us, peer_runs(built, scratch, edition), options)
        except NoPeerError as problem:
            print(f"throughput: {problem}", file=sys.stderr)
            return 1
    if not options.no_crowds:
        crowds = {str(size): us(size, size, 7) for size in CROWDS}
        counts = {size: judged.to_json() for size, judged in crowds.items()}
        limit = bound(sum(judged.answers for judged in crowds.values()))
        print(evidence(f"crowds at once, {edition.name}", counts, seeds=[7], bound=limit))
        is_good &= all(judged.is_clean for judged in crowds.values())
    return 0 if is_good else 1


def our_runs(built: Path, scratch: Path, edition: Edition) -> _Run:
    """Return what sends a crowd through a new server of ours: so many people, so many at once, a seed."""

    def _run(people: int, at_once: int, seed: int) -> Judged:
        instance = Path(tempfile.mkdtemp(dir=scratch)) / "instance"
        with edition.database(postgres.TEMPLATE) as url:
            words = () if url is None else ("--workers", str(edition.num_processes))
            settings = {} if url is None else {"DATABASE_URL": url}
            with ours.serve_ours(built, instance, *words, **settings) as running:
                plan = Plan(HOST, running.port, running.starts(people), ours.END, at_once, seed=seed)
                crowd = send(plan, running.pid, ports=[running.port] * edition.num_processes)
            _tell(crowd.problems)
            return judge(crowd, ours.told_to_us, ours.stored_by_us(instance, url))

    return _run


def peer_runs(built: Path, scratch: Path, edition: Edition) -> _Run:
    """Return what sends a crowd through a new server of oTree."""
    programs = install_peer()
    pictures = next((built / "bundles").glob("*/pictures"))

    def _run(people: int, at_once: int, seed: int) -> Judged:
        project = Path(tempfile.mkdtemp(dir=scratch)) / "project"
        with edition.database("template0") as url:
            with serve_peer(programs, project, pictures, url or "", edition.num_processes) as running:
                plan = Plan(HOST, running.ports[0], running.starts(people), END, at_once, seed=seed)
                crowd = send(plan, *running.pids, ports=running.ports)
            _tell(crowd.problems)
            return judge(crowd, told_to_peer, stored_by_peer(project, url or ""))

    return _run


def _compare(edition: Edition, us: _Run, peer: _Run, options: argparse.Namespace) -> bool:
    ours_found: list[Judged] = []
    peers_found: list[Judged] = []
    for seed in range(1, options.repetitions + 1):
        for run, found in ((us, ours_found), (peer, peers_found)):
            found.append(run(options.people, options.at_once, seed))
            print(found[-1].to_json(), file=sys.stderr)
    our_medians, peers_medians = medians(ours_found), medians(peers_found)
    ratio = our_medians["finished_per_s"] / peers_medians["finished_per_s"]
    counts = {"xar": our_medians, f"oTree {VERSION}": peers_medians}
    seeds = list(range(1, options.repetitions + 1))
    judged = {"wanted_ratio": edition.wanted_ratio, "ratio": round(ratio, 2), "repetitions": options.repetitions}
    told = {"at_once": options.at_once, "kind": options.kind, "web_processes": edition.num_processes}
    print(evidence(f"beside oTree, {edition.name}", counts, seeds=seeds, **judged, **told))
    return ratio >= edition.wanted_ratio and all(run.is_clean for run in ours_found)


def _tell(problems: Sequence[str]) -> None:
    for problem in sorted(set(problems))[:5]:
        print(f"stopped: {problem} ({problems.count(problem)} times)", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
