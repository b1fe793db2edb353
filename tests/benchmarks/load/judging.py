"""What is stored, compared with what was acknowledged, person by person."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from tests.benchmarks.load.crowds import Crowd
from tests.benchmarks.load.ours import Answers

Told = Callable[[Mapping[str, Any]], tuple[str, Mapping[tuple[str, str], str]]]
"""Says who a person is and what of theirs was acknowledged."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One crowd in numbers.

    Attributes:
        people: How many came.
        finished: How many of them came to the end.
        errors: How many were stopped by an error.
        answers: How many answers were acknowledged.
        lost: How many of these are not stored.
        mixed_up: How many are stored with another value, or belong to a person who is stored twice.
        finished_per_s: People who finished in a second.
        requests_per_person: Requests that were answered, redirects and pictures included.
        server_cpu_ms: The server's processor time for each person.
        generator_cpu_share: The generators' processor time, of one processor.
    """

    people: int
    finished: int
    errors: int
    answers: int
    lost: int
    mixed_up: int
    finished_per_s: float
    requests_per_person: float
    server_cpu_ms: float
    generator_cpu_share: float

    @property
    def is_clean(self) -> bool:
        """Whether everybody finished and every answer is where it belongs."""
        return self.finished == self.people and not (self.errors or self.lost or self.mixed_up)

    def to_json(self) -> dict[str, float]:
        """Return the numbers by name, rounded to what they are good for."""
        return {name: round(value, 3) for name, value in asdict(self).items()}


def judge(crowd: Crowd, told: Told, stored: Answers) -> Judged:
    """Compare a crowd's ledgers with what is stored."""
    ledgers = [told(person) for person in crowd.people]
    names = [name for name, ledger in ledgers if ledger]
    lost = mixed_up = 0
    for name, ledger in ledgers:
        theirs = stored.get(name, {})
        lost += sum(key not in theirs for key in ledger)
        mixed_up += sum(key in theirs and theirs[key] != value for key, value in ledger.items())
    people = len(crowd.people)
    return Judged(
        people=people,
        finished=crowd.num_finished,
        errors=len(crowd.problems),
        answers=sum(len(ledger) for _, ledger in ledgers),
        lost=lost,
        mixed_up=mixed_up + len(names) - len(set(names)),
        finished_per_s=crowd.finished_per_s,
        requests_per_person=crowd.num_requests / people,
        server_cpu_ms=1000 * crowd.server_cpu_s / people,
        generator_cpu_share=crowd.generator_cpu_s / crowd.took_s,
    )


def medians(runs: Sequence[Judged]) -> dict[str, float]:
    """Return the median of each number."""
    rows = [run.to_json() for run in runs]
    return {name: round(median(row[name] for row in rows), 3) for name in rows[0]}
