"""Send pages again, out of order, with nonces of others, after the end: the database holds what a model says (F10).

    python -m tests.faults.replay [--full] [--examples 200] [--steps 40]

Hypothesis draws what two people do, one step after the other, and looks for the shortest way to a contradiction. No
page may fail, and nobody may come further by a page that was refused. `--full` is 2,000 examples of 50 steps.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from unittest import mock

from flask import Flask
from hypothesis import HealthCheck, Phase, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from tests.faults.oracle import evidence
from tests.web.bundles import read_study, write_bundle
from tests.web.people import ITEMS, NUM_PAGES, Clock, Visitor, filled
from tests.web.reading import ask
from webapp.app import create_app
from webapp.config import Config
from webapp.views import forms
from webapp.views.services import services_of

NUM_PROCESSES = 2
NUMBERS = st.integers(1, NUM_PAGES)
RATINGS = st.fixed_dictionaries({item: st.integers(1, 5) for item in ITEMS})
_RATINGS = "SELECT page_number, item, rating FROM ratings WHERE participant_id = ?"
SPOILED = st.sampled_from(["", "0", "6", "-1", "3.0", "five", "1e0", "\x00"])


class Model:
    """What should be stored of one participant."""

    def __init__(self, visitor: Visitor, number: int) -> None:
        self.visitor = visitor
        self.row = number
        self.pages: list[dict[str, int]] = []
        self.has_left = False
        self.open_forms: list[tuple[int, str]] = []

    @property
    def place(self) -> str:
        if self.has_left:
            return "/left"
        return "/done" if len(self.pages) == NUM_PAGES else f"/study/{len(self.pages) + 1}"


class Participants(RuleBasedStateMachine):
    """Two browsers and a model of each."""

    app: Flask
    instance: Path
    steps: ClassVar[Counter[str]] = Counter()

    def __init__(self) -> None:
        super().__init__()
        self.people: list[Model] = []

    @rule()
    @precondition(lambda self: len(self.people) < 2)
    def agree(self) -> None:
        self.steps["agree"] += 1
        visitor = Visitor(self.app)
        assert visitor.agree().headers.get("Location") == "/study/1"
        ((number,),) = ask(self.instance, "SELECT max(id) FROM participants")
        assert isinstance(number, int)
        self.people.append(Model(visitor, number))

    @rule(data=st.data(), ratings=RATINGS)
    @precondition(lambda self: self.people)
    def answer(self, data: st.DataObject, ratings: dict[str, int]) -> None:
        self.steps["answer"] += 1
        person = self._somebody(data)
        if person.place.startswith("/study/"):
            number = len(person.pages) + 1
            self._send(person, number, person.visitor.nonce(number), ratings)

    @rule(data=st.data())
    @precondition(lambda self: self.people)
    def open_in_another_tab(self, data: st.DataObject) -> None:
        self.steps["open in another tab"] += 1
        person = self._somebody(data)
        if person.place.startswith("/study/"):
            number = len(person.pages) + 1
            person.open_forms.append((number, person.visitor.nonce(number)))

    @rule(data=st.data(), ratings=RATINGS)
    @precondition(lambda self: any(person.open_forms for person in self.people))
    def send_from_another_tab(self, data: st.DataObject, ratings: dict[str, int]) -> None:
        self.steps["send from another tab"] += 1
        person = data.draw(st.sampled_from([person for person in self.people if person.open_forms]))
        number, nonce = data.draw(st.sampled_from(person.open_forms))
        self._send(person, number, nonce, ratings)

    @rule(data=st.data(), number=NUMBERS, ratings=RATINGS)
    @precondition(lambda self: self.people)
    def send_any_page_with_a_nonce_of_anybody(self, data: st.DataObject, number: int, ratings: dict[str, int]) -> None:
        self.steps["send any page with a nonce of anybody"] += 1
        person = self._somebody(data)
        nonces = [(*form, owner) for owner in self.people for form in owner.open_forms]
        own, nonce, owner = data.draw(st.sampled_from([*nonces, (0, "0" * 32, None)]))
        self._send(person, number, nonce, ratings, is_own=owner is person and own == number)

    @rule(data=st.data(), item=st.sampled_from(ITEMS), spoiled=SPOILED)
    @precondition(lambda self: self.people)
    def send_a_spoiled_page(self, data: st.DataObject, item: str, spoiled: str) -> None:
        self.steps["send a spoiled page"] += 1
        person = self._somebody(data)
        number = len(person.pages) + 1
        if person.place.startswith("/study/") and number >= 3 and number % 2 == 1:
            form = filled(number, person.visitor.nonce(number)) | {f"rating-{item}": spoiled}
            assert person.visitor.post(f"/study/{number}", form).status_code == 422

    @rule(data=st.data(), number=NUMBERS)
    @precondition(lambda self: self.people)
    def look_at_any_page(self, data: st.DataObject, number: int) -> None:
        self.steps["look at any page"] += 1
        person = self._somebody(data)
        answer = person.visitor.get(f"/study/{number}")
        if person.place == f"/study/{number}":
            assert answer.status_code == 200
        else:
            assert answer.headers.get("Location") == person.place

    @rule(data=st.data())
    @precondition(lambda self: self.people)
    def agree_again(self, data: st.DataObject) -> None:
        self.steps["agree again"] += 1
        person = self._somebody(data)
        if person.place.startswith("/study/"):
            assert person.visitor.post("/consent", {"agree": "yes"}).headers.get("Location") == person.place

    @rule(data=st.data(), is_sure=st.integers(0, 4).map(lambda number: number == 0))
    @precondition(lambda self: self.people)
    def leave(self, data: st.DataObject, is_sure: bool) -> None:
        self.steps["leave"] += 1
        person = self._somebody(data)
        person.visitor.get("/leave")
        if is_sure:
            person.visitor.post("/leave")
            person.has_left = len(person.pages) < NUM_PAGES or person.has_left

    @invariant()
    def the_database_holds_what_the_model_says(self) -> None:
        for person in self.people:
            own: dict[object, dict[object, object]] = {}
            for page, item, rating in ask(self.instance, _RATINGS, person.row):
                own.setdefault(page, {})[item] = rating
            assert own == {page: ratings for page, ratings in enumerate(person.pages, start=1) if ratings}
            question = "SELECT count(*) FROM pages WHERE participant_id = ?"
            assert ask(self.instance, question, person.row) == [(len(person.pages),)]
            assert person.visitor.place() == person.place

    def _somebody(self, data: st.DataObject) -> Model:
        return data.draw(st.sampled_from(self.people))

    def _send(self, person: Model, number: int, nonce: str, ratings: dict[str, int], *, is_own: bool = True) -> None:
        changes = {f"rating_{item}": str(rating) for item, rating in ratings.items()}
        is_rating = number >= 3 and number % 2 == 1
        form = filled(number, nonce, **(changes if is_rating else {}))
        is_due = person.place == f"/study/{number}"
        answer = person.visitor.post(f"/study/{number}", form)
        if is_due and is_own:
            person.pages.append(ratings if is_rating else {})
        assert (answer.status_code, answer.headers.get("Location")) == (303, person.place)


def run_machine(
    app: Flask, instance: Path, num_examples: int, num_steps: int, seed: int = 1, *, shrinks: bool = True
) -> Counter[str]:
    """Let Hypothesis try, and return how often each step was made.

    Args:
        app: What is tried.
        instance: Its folder.
        num_examples: How many sequences.
        num_steps: How many steps a sequence may have.
        seed: Of the sequences.
        shrinks: Whether to look for the shortest sequence that shows what is wrong.

    Raises:
        AssertionError: Something was stored that the model does not know, or the other way round, or a page failed.
    """
    steps: Counter[str] = Counter()
    parts = {"app": app, "instance": instance, "steps": steps}
    machine = seeded(seed)(type("ParticipantsOfThisApp", (Participants,), parts))
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
    chosen = settings(
        max_examples=num_examples,
        stateful_step_count=num_steps,
        suppress_health_check=slow,
        phases=[Phase.generate, *([Phase.shrink] if shrinks else [])],
        database=None,
        report_multiple_bugs=False,
        print_blob=False,
    )
    run_state_machine_as_test(machine, settings=chosen)
    return steps


@contextmanager
def nonces_unread() -> Iterator[None]:
    """As a control, take a page from anybody who is at it, whatever nonce comes with it."""
    with mock.patch.object(forms, "same", return_value=True):
        yield


@dataclass(frozen=True, slots=True)
class Trial:
    """What is tried, in a process of its own.

    Attributes:
        num_examples: How many sequences.
        num_steps: How many steps a sequence may have.
        seed: Of the sequences.
        without_nonces: Whether it is the control.
    """

    num_examples: int
    num_steps: int
    seed: int
    without_nonces: bool = False

    def run(self) -> tuple[Counter[str], str]:
        """Return how often each step was made, and what went otherwise than in the model; empty if nothing."""
        with tempfile.TemporaryDirectory() as scratch, nonces_unread() if self.without_nonces else nullcontext():
            instance = Path(scratch, "instance")
            write_bundle(instance, read_study())
            app = create_app(Config(instance), clock=Clock())
            try:
                return run_machine(
                    app, instance, self.num_examples, self.num_steps, self.seed, shrinks=not self.without_nonces
                ), ""
            except AssertionError as error:
                return Counter(), str(error) or "a page was not answered as the model says"
            finally:
                services_of(app).database.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evidence and return 0 if the model was right, and found the control out."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--full", action="store_true", help="2,000 examples of 50 steps")
    parser.add_argument("--examples", type=int, default=200)
    parser.add_argument("--steps", type=int, default=40)
    options = parser.parse_args(arguments)
    num_examples, num_steps = (2000, 50) if options.full else (options.examples, options.steps)
    began = time.monotonic()
    seeds = range(1, NUM_PROCESSES + 1)
    trials = [Trial(num_examples // NUM_PROCESSES, num_steps, seed) for seed in seeds]
    with ProcessPoolExecutor(NUM_PROCESSES) as pool:
        found = list(pool.map(Trial.run, trials))
    seconds = round(time.monotonic() - began)
    _, noticed = Trial(200, num_steps, 1, without_nonces=True).run()
    steps = sum((counted for counted, _ in found), Counter[str]())
    contradictions = [told for _, told in found if told]
    counts = {"examples": num_examples, "steps_at_most": num_steps, "steps": steps.total()}
    print(
        evidence(
            "F10 replayed, reordered and skipped",
            counts | {"contradictions": contradictions},
            by_step=dict(sorted(steps.items())),
            seeds=list(seeds),
            seconds=seconds,
            control={"nonces unread": {"contradictions": int(bool(noticed))}},
        )
    )
    return 0 if noticed and not contradictions else 1


if __name__ == "__main__":
    sys.exit(main())
