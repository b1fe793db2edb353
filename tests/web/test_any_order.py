"""Whatever participants send, in whatever order: the database holds what a simple model says, and no page fails."""

from pathlib import Path

from flask import Flask
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from tests.web.people import ITEMS, NUM_PAGES, Visitor, filled
from tests.web.reading import ask, stored_ratings

NUMBERS = st.integers(1, NUM_PAGES)
RATINGS = st.fixed_dictionaries({item: st.integers(1, 5) for item in ITEMS})
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

    def __init__(self) -> None:
        super().__init__()
        self.people: list[Model] = []

    @rule()
    @precondition(lambda self: len(self.people) < 2)
    def agree(self) -> None:
        visitor = Visitor(self.app)
        assert visitor.agree().headers["Location"] == "/study/1"
        ((number,),) = ask(self.instance, "SELECT max(id) FROM participants")
        assert isinstance(number, int)
        self.people.append(Model(visitor, number))

    @rule(data=st.data(), ratings=RATINGS)
    @precondition(lambda self: self.people)
    def answer(self, data: st.DataObject, ratings: dict[str, int]) -> None:
        person = self._somebody(data)
        if person.place.startswith("/study/"):
            number = len(person.pages) + 1
            self._send(person, number, person.visitor.nonce(number), ratings)

    @rule(data=st.data())
    @precondition(lambda self: self.people)
    def open_in_another_tab(self, data: st.DataObject) -> None:
        person = self._somebody(data)
        if person.place.startswith("/study/"):
            number = len(person.pages) + 1
            person.open_forms.append((number, person.visitor.nonce(number)))

    @rule(data=st.data(), ratings=RATINGS)
    @precondition(lambda self: any(person.open_forms for person in self.people))
    def send_from_another_tab(self, data: st.DataObject, ratings: dict[str, int]) -> None:
        person = data.draw(st.sampled_from([person for person in self.people if person.open_forms]))
        number, nonce = data.draw(st.sampled_from(person.open_forms))
        self._send(person, number, nonce, ratings)

    @rule(data=st.data(), number=NUMBERS, ratings=RATINGS)
    @precondition(lambda self: self.people)
    def send_any_page_with_a_nonce_of_anybody(self, data: st.DataObject, number: int, ratings: dict[str, int]) -> None:
        person = self._somebody(data)
        nonces = [(*form, owner) for owner in self.people for form in owner.open_forms]
        own, nonce, owner = data.draw(st.sampled_from([*nonces, (0, "0" * 32, None)]))
        self._send(person, number, nonce, ratings, is_own=owner is person and own == number)

    @rule(data=st.data(), item=st.sampled_from(ITEMS), spoiled=SPOILED)
    @precondition(lambda self: self.people)
    def send_a_spoiled_page(self, data: st.DataObject, item: str, spoiled: str) -> None:
        person = self._somebody(data)
        number = len(person.pages) + 1
        if person.place.startswith("/study/") and number >= 3 and number % 2 == 1:
            form = filled(number, person.visitor.nonce(number)) | {f"rating-{item}": spoiled}
            assert person.visitor.post(f"/study/{number}", form).status_code == 422

    @rule(data=st.data(), number=NUMBERS)
    @precondition(lambda self: self.people)
    def look_at_any_page(self, data: st.DataObject, number: int) -> None:
        person = self._somebody(data)
        answer = person.visitor.get(f"/study/{number}")
        if person.place == f"/study/{number}":
            assert answer.status_code == 200
        else:
            assert answer.headers["Location"] == person.place

    @rule(data=st.data())
    @precondition(lambda self: self.people)
    def agree_again(self, data: st.DataObject) -> None:
        person = self._somebody(data)
        if person.place.startswith("/study/"):
            assert person.visitor.post("/consent", {"agree": "yes"}).headers["Location"] == person.place

    @rule(data=st.data(), is_sure=st.integers(0, 4).map(lambda number: number == 0))
    @precondition(lambda self: self.people)
    def leave(self, data: st.DataObject, is_sure: bool) -> None:
        person = self._somebody(data)
        person.visitor.get("/leave")
        if is_sure:
            person.visitor.post("/leave")
            person.has_left = len(person.pages) < NUM_PAGES or person.has_left

    @invariant()
    def the_database_holds_what_the_model_says(self) -> None:
        stored = stored_ratings(self.instance)
        for person in self.people:
            own = {page: ratings for (row, page), ratings in stored.items() if row == person.row}
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
        assert (answer.status_code, answer.headers["Location"]) == (303, person.place)


def test_whatever_is_sent_in_whatever_order_is_lost_doubled_or_changed_never(app: Flask, instance: Path) -> None:
    machine = type("ParticipantsOfThisApp", (Participants,), {"app": app, "instance": instance})
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
    run_state_machine_as_test(
        machine, settings=settings(max_examples=10, stateful_step_count=40, suppress_health_check=slow)
    )
