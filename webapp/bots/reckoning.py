"""Whether what bots were told is stored is stored, once and unchanged."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from webapp.bots.running import Report
from webapp.storage.database import Database
from webapp.storage.participants import find_participant
from webapp.storage.read_back import Entry, read_back


@dataclass(frozen=True, slots=True)
class Reckoning:
    """What a comparison of everything acknowledged with the database found.

    Attributes:
        num_pages: How many pages were acknowledged.
        num_entries: How many rows of answers, actions and pages these have to be.
        lost: What was acknowledged and is not stored like that, a line for each.
        doubled: What is stored and was sent once, otherwise or never, a line for each.
    """

    num_pages: int
    num_entries: int
    lost: tuple[str, ...]
    doubled: tuple[str, ...]


def reckon(reports: Sequence[Report], database: Database) -> Reckoning:
    """Compare all pages, answers and actions that bots sent, with their times, with what is stored of them."""
    lost, doubled = list[str](), list[str]()
    for report in reports:
        doubled += _enrolled_twice(report, database)
        for what, lines in _compare(report, database):
            (lost if what == "lost" else doubled).extend(lines)
    entries = [entry for report in reports for page in report.ledger.acknowledged.values() for entry in page]
    return Reckoning(sum(entry == ("page",) for entry in entries), len(entries), tuple(lost), tuple(doubled))


def _compare(report: Report, database: Database) -> Iterator[tuple[str, list[str]]]:
    if report.participant is None:
        return
    stored, code = read_back(database, report.participant), report.participant.code
    sent, under_way = report.ledger.acknowledged, report.ledger.under_way
    for number in sorted({*stored, *sent}):
        told, there = Counter(sent.get(number, [])), Counter(stored.get(number, []))
        yield "lost", _lines(code, number, told - there)
        yield "doubled", _lines(code, number, there - told - Counter(under_way.get(number, [])))


def _enrolled_twice(report: Report, database: Database) -> list[str]:
    if report.participant is None:
        return []
    others = sorted(report.token_hashes - {report.participant.token_hash})
    found = [other for other in (find_participant(database, token_hash) for token_hash in others) if other is not None]
    return [f"bot {report.plan.number} was enrolled once more, as {other.code}" for other in found]


def _lines(code: str, number: int, entries: Counter[Entry]) -> list[str]:
    return [f"{code}, page {number}: {' '.join(entry)}" for entry in sorted(entries.elements())]
