"""Participants steer the agent: each action is stored once, the outcome is measured, explanations are made from it."""

import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from flask import Flask
from werkzeug.test import TestResponse

from tests.web.bundles import PATH, SUBGOALS, WAY, write_bundle
from tests.web.people import SAME_SITE, Visitor, hidden_nonce
from tests.web.reading import ask, num_rows
from tests.web.studies import a_study, one_experiment
from webapp.config import Config
from webapp.storage.helping import restart_page
from webapp.views.services import services_of, utc_now

OUTCOME = 'SELECT phase, "end", num_steps, optimum, step_limit, subgoals_passed, key_points FROM drives'
JSON = SAME_SITE | {"Accept": "application/json"}


class Driver:
    """A participant whose third page, or another, is a drive."""

    def __init__(self, visitor: Visitor, number: int) -> None:
        self.visitor = visitor
        self.number = number
        self.nonce = visitor.nonce(number)
        self.step = 0

    def act(self, action: str, step: int | None = None, *, script: bool = False) -> TestResponse:
        self.step = self.step + 1 if step is None else step
        form = {"nonce": self.nonce, "step": str(self.step), "action": action, "elapsed": str(1000 * self.step)}
        headers = JSON if script else SAME_SITE
        return self.visitor.client.post(f"/study/{self.number}/action", data=form, headers=headers)

    def drive(self, *actions: str) -> None:
        for action in actions:
            assert self.act(action).status_code == 303


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    return tmp_path / "instance"


@pytest.fixture
def app(instance: Path, start_app: Callable[[Config], Flask]) -> Callable[..., Flask]:
    def start(**settings: Any) -> Flask:  # noqa: ANN401
        settings = {"kinds": ["subgoals"], "drive": {}} | settings
        write_bundle(instance, a_study(experiments=one_experiment(**settings)))
        return start_app(Config(instance))

    return start


def arrive(app: Flask, last: int = 3) -> Visitor:
    """Agree, and answer the first pages."""
    visitor = Visitor(app)
    visitor.agree()
    for number in range(1, last + 1):
        form = {"nonce": visitor.nonce(number), "rating-likeliness": "4", "rating-general": "2"}
        assert visitor.post(f"/study/{number}", form).status_code == 303
    return visitor


def test_reaching_the_goal_ends_the_drive_and_is_measured(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app())
    driver = Driver(visitor, 4)
    driver.drive(*WAY)
    assert visitor.place() == "/done"
    assert "You have reached the goal." in visitor.get("/done").text
    assert ask(instance, OUTCOME) == [("after", "reached", 7, 7, 21, "1 5 7", "")]
    steps = ask(instance, "SELECT number, action, elapsed_ms FROM drive_steps ORDER BY number")
    assert steps == [(number, action, 1000 * number) for number, action in enumerate(WAY, start=1)]
    assert ask(instance, "SELECT count(*) FROM pages WHERE kind = 'drive'") == [(1,)]


def test_the_view_after_each_action_is_the_worlds(app: Callable[..., Flask]) -> None:
    visitor = arrive(app())
    driver = Driver(visitor, 4)
    assert 'alt="View 0."' in visitor.get("/study/4").text
    seen = [driver.act(action, script=True).json for action in WAY[:-1]]
    assert all(state is not None and state["next"] is None for state in seen)
    assert [state["step"] for state in seen if state] == list(range(2, 8))
    assert seen[0] is not None
    assert seen[0]["message"] == "You picked up the key."
    assert seen[0]["steps_left"] == "20 steps left"
    last = seen[-1]
    assert last is not None
    assert f'alt="{last["alt"]}"' in visitor.get("/study/4").text
    assert driver.act(WAY[-1], script=True).json == {"next": "/done"}


def test_the_log_of_a_drive_is_stored_with_its_end(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app())
    log = '[["painted","","",0],["focus_lost","","",700],["focus_regained","","",900]]'
    for step, action in enumerate(("left", "give_up"), start=1):
        form = {"nonce": visitor.nonce(4), "step": str(step), "action": action, "events": log}
        assert visitor.post("/study/4/action", form).status_code == 303
    rows = ask(instance, "SELECT event, at_ms FROM events WHERE page_number = 4 ORDER BY number")
    assert rows == [("painted", 0), ("focus_lost", 700), ("focus_regained", 900)]


def test_an_action_that_cannot_act_counts_and_says_so(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app())
    state = Driver(visitor, 4).act("toggle", script=True).json
    assert state is not None
    assert (state["message"], state["step"]) == ("Nothing happened.", 2)
    assert num_rows(instance, "drive_steps") == 1


def test_giving_up_is_an_outcome_and_no_action(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app())
    driver = Driver(visitor, 4)
    driver.drive("pickup", "left", "give_up")
    assert ask(instance, OUTCOME) == [("after", "gave_up", 2, 7, 21, "1", "5 7")]
    assert "stopped before the goal" in visitor.get("/done").text


def test_the_last_step_ends_the_drive(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app(drive={"steps_per_optimal_step": 1.1}))
    driver = Driver(visitor, 4)
    driver.drive(*["left"] * 7)
    assert "1 step left" in visitor.get("/study/4").text
    driver.drive("left")
    assert visitor.place() == "/done"
    assert ask(instance, OUTCOME) == [("after", "step_limit", 8, 7, 8, "", "1 5 7")]


def test_the_goal_at_the_last_step_is_reached(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app(drive={"steps_per_optimal_step": 1}))
    Driver(visitor, 4).drive(*WAY)
    assert ask(instance, 'SELECT "end" FROM drives') == [("reached",)]


class TestSentAgain:
    def test_a_double_click_is_one_action(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = arrive(app())
        driver = Driver(visitor, 4)
        for _ in range(2):
            assert driver.act("left", step=1).status_code == 303
        assert "your first answer stands" in visitor.get("/study/4").text
        assert ask(instance, "SELECT action FROM drive_steps") == [("left",)]

    def test_a_second_tab_sees_where_the_first_one_is(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = arrive(app())
        driver = Driver(visitor, 4)
        driver.drive("pickup", "left")
        state = driver.act("right", step=1, script=True).json
        assert state is not None
        assert (state["step"], state["stands"]) == (3, True)
        assert "your first answer stands" in state["message"]
        assert num_rows(instance, "drive_steps") == 2

    def test_an_answer_that_got_lost_is_given_again_without_a_word(self, app: Callable[..., Flask]) -> None:
        visitor = arrive(app())
        driver = Driver(visitor, 4)
        first = driver.act("pickup", step=1, script=True).json
        assert driver.act("pickup", step=1, script=True).json == first
        assert first is not None
        assert first["stands"] is False

    def test_a_step_that_comes_too_early_is_not_taken(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = arrive(app())
        Driver(visitor, 4).act("left", step=5)
        assert num_rows(instance, "drive_steps") == 0

    def test_twenty_at_once_are_one(self, app: Callable[..., Flask], instance: Path) -> None:
        flask = app()
        visitor = arrive(flask)
        cookie = visitor.client.get_cookie("participant")
        assert cookie is not None
        nonce, barrier, statuses = visitor.nonce(4), threading.Barrier(20), []

        def send() -> None:
            client = flask.test_client()
            client.set_cookie("participant", cookie.value)
            barrier.wait()
            form = {"nonce": nonce, "step": "1", "action": "forward"}
            statuses.append(client.post("/study/4/action", data=form, headers=JSON).status_code)

        threads = [threading.Thread(target=send) for _ in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert statuses == [200] * 20
        assert num_rows(instance, "drive_steps") == 1

    def test_nothing_is_taken_after_the_end(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = arrive(app())
        driver = Driver(visitor, 4)
        driver.drive("give_up")
        driver.act("left", step=1)
        driver.act("give_up")
        assert num_rows(instance, "drive_steps") == 0
        assert num_rows(instance, "drives") == 1

    def test_nor_from_somebody_who_left(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = arrive(app())
        driver = Driver(visitor, 4)
        visitor.post("/leave")
        assert driver.act("left").headers["Location"] == "/left"
        assert num_rows(instance, "drive_steps") == 0


@pytest.mark.parametrize(
    "form",
    [
        {"action": "fly", "step": "1"},
        {"action": "left", "step": "one"},
        {"action": "left"},
        {"action": "left", "step": "-1"},
        {"step": "1"},
    ],
)
def test_what_is_no_action_changes_nothing(app: Callable[..., Flask], instance: Path, form: dict[str, str]) -> None:
    visitor = arrive(app())
    answer = visitor.post("/study/4/action", form | {"nonce": visitor.nonce(4)})
    assert answer.headers["Location"] == "/study/4"
    assert num_rows(instance, "drive_steps") == 0


def test_a_drive_can_neither_be_skipped_nor_started_early(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app(), last=1)
    assert visitor.post("/study/4/action", {"action": "left", "step": "1"}).headers["Location"] == "/study/2"
    assert visitor.post("/study/2/action", {"action": "left", "step": "1"}).status_code == 404
    visitor = arrive(app())
    for forged in ({}, {"action": "forward", "step": "1"}, {"action": "give_up"}):
        assert visitor.post("/study/4", forged | {"nonce": visitor.nonce(4)}).headers["Location"] == "/study/4"
    assert num_rows(instance, "drives") == 0


def test_a_drive_goes_on_where_it_was_left(app: Callable[..., Flask]) -> None:
    visitor = arrive(app())
    Driver(visitor, 4).drive("pickup", "left")
    page = visitor.get("/study/4").text
    assert "19 steps left" in page
    assert 'name="step" value="3"' in page
    assert "You turned left." in page


class TestTailored:
    """Kind `tailored`: pages are instructions, situation, first drive, rating, drive."""

    def explained(self, visitor: Visitor) -> tuple[list[str], str]:
        """The alternative texts of the explanation's pictures, and the page."""
        page = visitor.get("/study/4").text
        stage = re.search(r"data-explanation.*?<details", page, flags=re.DOTALL)
        assert stage is not None
        return re.findall(r'alt="View (\d+)\."', stage[0]), page

    def pictures_of(self, *steps: int) -> list[str]:
        shown = [PATH.states[0]]
        for step in steps:
            shown += [PATH.states[step]] if step == len(WAY) else list(PATH.states[step - 1 : step + 1])
        return [str(state) for state in shown]

    @pytest.mark.parametrize(
        ("kind", "actions", "missing", "shown"),
        [
            ("tailored_all", ("pickup", "left", "left", "forward", "forward", "give_up"), "5 7", (5, 7)),
            ("tailored_first", ("pickup", "left", "left", "forward", "forward", "give_up"), "5 7", (5,)),
            ("tailored_all", ("give_up",), "1 5 7", SUBGOALS),
            ("tailored_first", ("left", "give_up"), "1 5 7", (1,)),
        ],
    )
    def test_what_was_missing_is_shown(
        self,
        app: Callable[..., Flask],
        instance: Path,
        kind: str,
        actions: tuple[str, ...],
        missing: str,
        shown: tuple[int, ...],
    ) -> None:
        visitor = arrive(app(kinds=[kind]), last=2)
        Driver(visitor, 3).drive(*actions)
        pictures, page = self.explained(visitor)
        assert pictures == self.pictures_of(*shown)
        assert "This is what was missing on your way." in page
        assert ask(instance, "SELECT phase, key_points FROM drives") == [("before", missing)]

    @pytest.mark.parametrize("kind", ["tailored_all", "tailored_first"])
    def test_who_arrives_alone_is_told_that_nothing_is_missing_and_sees_the_subgoals(
        self, app: Callable[..., Flask], instance: Path, kind: str
    ) -> None:
        visitor = arrive(app(kinds=[kind]), last=2)
        Driver(visitor, 3).drive(*WAY)
        pictures, page = self.explained(visitor)
        assert pictures == self.pictures_of(*SUBGOALS)
        assert "nothing was missing on your way" in page
        assert ask(instance, 'SELECT phase, "end", key_points FROM drives') == [("before", "reached", "")]

    def test_then_they_drive_again(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = arrive(app(kinds=["tailored_all"]), last=2)
        Driver(visitor, 3).drive("give_up")
        form = {"rating-likeliness": "4", "rating-general": "2", "nonce": visitor.nonce(4)}
        visitor.post("/study/4", form)
        Driver(visitor, 5).drive(*WAY)
        assert visitor.place() == "/done"
        rows = ask(instance, 'SELECT phase, "end" FROM drives ORDER BY page_number')
        assert rows == [("before", "gave_up"), ("after", "reached")]


def test_the_practice_is_a_drive_of_its_own(instance: Path, start_app: Callable[[Config], Flask]) -> None:
    study = a_study(experiments=one_experiment(["subgoals"]), practice={"layout": "simulation"})
    write_bundle(instance, study)
    visitor = arrive(start_app(Config(instance)), last=1)
    page = visitor.get("/study/2").text
    assert "This is practice" in page
    assert "three squares by three" in page
    Driver(visitor, 2).drive("left", "give_up")
    assert "The practice is over" in visitor.get("/study/3").text
    assert ask(instance, 'SELECT phase, layout, "end" FROM drives') == [("practice", "simulation", "gave_up")]


def test_the_nonce_of_a_drive_is_needed(app: Callable[..., Flask], instance: Path) -> None:
    visitor = arrive(app())
    foreign = hidden_nonce(arrive(app()).get("/study/4"))
    answer = visitor.post("/study/4/action", {"action": "left", "step": "1", "nonce": foreign})
    assert answer.headers["Location"] == "/study/4"
    assert num_rows(instance, "drive_steps") == 0


def test_a_window_from_before_a_drive_was_begun_anew_cannot_act_in_it(
    app: Callable[..., Flask], instance: Path
) -> None:
    started = app()
    visitor = arrive(started)
    old = Driver(visitor, 4)
    old.drive("left", "left")
    ((code,),) = ask(instance, "SELECT code FROM participants")
    restart_page(services_of(started).database, str(code), 4, "the window froze", "boss", utc_now())
    assert 'alt="View 0."' in visitor.get("/study/4").text
    assert old.act("forward", step=1).headers["Location"] == "/study/4"
    old.act("give_up")
    assert ask(instance, "SELECT count(*) FROM drive_steps") == [(2,)]
    assert num_rows(instance, "drives") == 0
    Driver(visitor, 4).drive(*WAY)
    assert ask(instance, OUTCOME) == [("after", "reached", 7, 7, 21, "1 5 7", "")]
