"""Set the clock while people take part: `python -m tests.faults.clock [--full] [--people 6]` (F8).

The clock is the one that the program is given; it jumps while everybody is half-way. Nobody may be signed out by that,
no place may be given back early, what people's browsers measured stays as it was sent, and the record keeps its order.
A jump ahead by an hour is an exception by nature: to the server everybody was silent for that long. Places that were
lent for an hour go back then, until their owners send the next page, and a researcher signs in again. `--full` is 48
people for each jump.
"""

import argparse
import os
import random
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest import mock

from sqlalchemy import bindparam, update

from tests.faults.oracle import evidence
from tests.web.bundles import read_study, write_bundle
from tests.web.people import ITEMS, NUM_PAGES, Clock, Visitor
from tests.web.reading import ask, place
from tests.web.researchers import researcher_of
from webapp.app import create_app
from webapp.storage import answer_rows
from webapp.storage.tables import participants
from webapp.storage.verification import verify_log
from webapp.views.services import services_of

_ZONE = "Europe/Berlin"
_RELEASED = "SELECT count(*) FROM records WHERE action = 'slot_released'"
_TIMES = "SELECT page_number, item, response_time_ms FROM ratings"
_NUMBERS = "SELECT number FROM records ORDER BY number"


@dataclass(frozen=True, slots=True)
class Jump:
    """How the clock is set.

    Attributes:
        begins_at: What it shows when people agree.
        steps: By how much it is set each time; before each of them everybody sends a page.
        idle: How long nothing happens after the last of them.
        is_ahead: Whether the server cannot but believe that everybody was silent for too long.
    """

    begins_at: datetime
    steps: tuple[timedelta, ...]
    idle: timedelta = timedelta()
    is_ahead: bool = False


_SPRING = datetime(2031, 3, 1, 9, 30, tzinfo=UTC)
_HOUR, _TEN_MINUTES, _MINUTES = timedelta(hours=1), timedelta(minutes=10), timedelta(minutes=2)

JUMPS: Mapping[str, Jump] = {
    "an hour back": Jump(_SPRING, (-_HOUR,)),
    "an hour ahead": Jump(_SPRING, (_HOUR,), is_ahead=True),
    "ten minutes back": Jump(_SPRING, (-_TEN_MINUTES,)),
    "ten minutes back, right again": Jump(_SPRING, (-_TEN_MINUTES, _TEN_MINUTES), idle=timedelta(minutes=52)),
    "into summer time": Jump(datetime(2031, 3, 30, 0, 59, tzinfo=UTC), (_MINUTES,)),
    "out of summer time": Jump(datetime(2031, 10, 26, 0, 59, tzinfo=UTC), (_MINUTES,)),
    "beyond 32 bits of seconds": Jump(datetime(2038, 1, 19, 3, 13, tzinfo=UTC), (_MINUTES,)),
    "beyond 2106": Jump(datetime(2106, 2, 7, 6, 27, tzinfo=UTC), (_MINUTES,)),
}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a jump.

    Attributes:
        num_people: How many took part, and finished.
        num_signed_out: How many were not where they had been.
        num_researchers_signed_out: 1 if the researcher has to sign in again.
        num_places_lost: How many places were given back when the next newcomer came, although nobody had left.
        num_times_changed: How many response times are not as they were sent.
        num_problems: What is wrong with the record: its chain, or a number that is missing.
    """

    num_people: int
    num_signed_out: int
    num_researchers_signed_out: int
    num_places_lost: int
    num_times_changed: int
    num_problems: int

    def is_clean(self, jump: Jump) -> bool:
        """Whether everything is as promised for a jump."""
        harm = self.num_signed_out + self.num_times_changed + self.num_problems
        return harm == 0 and (jump.is_ahead or self.num_places_lost == self.num_researchers_signed_out == 0)

    def to_json(self) -> dict[str, int]:
        """Return the counts by name."""
        return {name.removeprefix("num_"): getattr(self, name) for name in self.__slots__}


def jump_and_compare(instance: Path, jump: Jump, num_people: int, seed: int = 1) -> Outcome:
    """Let people begin, set the clock, let them finish, and look at what is stored.

    Args:
        instance: Where to make the instance.
        jump: How the clock is set.
        num_people: How many take part.
        seed: Of how far they are by then.
    """
    write_bundle(instance, read_study())
    clock = Clock(jump.begins_at)
    rng = random.Random(seed)
    with _in_zone(_ZONE):
        app = create_app(place(instance), clock=clock)
        try:
            researcher = researcher_of(app)
            people = [Visitor(app) for _ in range(num_people)]
            at = {nth: rng.randint(1, NUM_PAGES - 4) for nth in range(num_people)}
            for nth, person in enumerate(people):
                person.agree()
                person.walk(last=at[nth])
            num_signed_out = 0
            for number, step in enumerate((timedelta(), *jump.steps)):
                clock.time += step
                is_researcher_out = researcher.get("/researcher/").status_code != 200
                for nth, person in enumerate(people):
                    if number < len(jump.steps):
                        at[nth] += 1
                        person.walk(first=at[nth], last=at[nth])
            clock.time += jump.idle
            newcomer = Visitor(app)
            newcomer.agree()
            ((num_released,),) = ask(instance, _RELEASED)
            assert isinstance(num_released, int)
            for nth, person in enumerate(people):
                num_signed_out += person.get("/study").headers.get("Location") != f"/study/{at[nth] + 1}"
                person.walk(first=at[nth] + 1)
                num_signed_out += person.place() != "/done"
            newcomer.walk()
            numbers = [number for (number,) in ask(instance, _NUMBERS)]
            problems = len(verify_log(services_of(app).database).problems) + (
                numbers != list(range(1, len(numbers) + 1))
            )
        finally:
            services_of(app).database.close()
    sent = {(page, item): 1000 * page + nth for page in range(1, NUM_PAGES + 1) for nth, item in enumerate(ITEMS)}
    changed = sum(sent[int(str(page)), str(item)] != time_ms for page, item, time_ms in ask(instance, _TIMES))
    return Outcome(num_people, num_signed_out, int(is_researcher_out), num_released, changed, problems)


@contextmanager
def _in_zone(zone: str) -> Iterator[None]:
    """Let this process believe that it is elsewhere."""
    with mock.patch.dict(os.environ, TZ=zone):
        time.tzset()
        yield
    time.tzset()


@contextmanager
def signs_of_life_as_they_come() -> Iterator[None]:
    """As a control, believe the clock when it says that somebody's last sign of life was before the one before."""
    touch = update(participants).values(last_seen_at=bindparam("now"))
    closely, in_passing = touch.where(participants.c.id == bindparam("whose")), touch.where(*answer_rows._AS_READ)
    with mock.patch.object(answer_rows, "_TOUCH", closely), mock.patch.object(answer_rows, "_GO_ON", in_passing):
        yield


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if no jump did any harm, and one did in the control."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="48 people")
    parser.add_argument("--people", type=int, default=6)
    options = parser.parse_args(arguments)
    num_people = 48 if options.full else options.people
    with tempfile.TemporaryDirectory() as scratch:
        found = {name: jump_and_compare(Path(scratch, name), jump, num_people) for name, jump in JUMPS.items()}
        jump = JUMPS["ten minutes back, right again"]
        with signs_of_life_as_they_come():
            control = jump_and_compare(Path(scratch, "control"), jump, num_people)
    print(
        evidence(
            "F8 the clock jumps",
            {name: outcome.to_json() for name, outcome in found.items()},
            zone=_ZONE,
            control={"signs of life as they come": control.to_json()},
        )
    )
    return 0 if all(found[name].is_clean(jump) for name, jump in JUMPS.items()) and control.num_places_lost else 1


if __name__ == "__main__":
    sys.exit(main())
