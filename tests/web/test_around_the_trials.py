"""What stands around the trials: age, background questions, quiz, attention checks, satisfaction, debriefing."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest
from flask import Flask

from tests.web.bundles import write_bundle
from tests.web.people import Visitor, filled, hidden_nonce
from tests.web.reading import ask, num_rows
from tests.web.studies import BACKGROUND, CHECKS, QUIZ, RIGHT, WRONG, a_study, one_experiment
from webapp.config import Config
from webapp.study.experiments import SATISFACTION_ITEMS

Visit = Callable[..., Visitor]

BACKGROUND_ANSWERS = {"answer-age": "33", "answer-gender": "another", "answer-robots": "I built one, once."}


@pytest.fixture
def visit(tmp_path: Path, start_app: Callable[[Config], Flask]) -> Visit:
    """Let somebody arrive at a study with these sections."""

    def arrive(**sections: Any) -> Visitor:  # noqa: ANN401
        write_bundle(tmp_path / "instance", a_study(**sections))
        return Visitor(start_app(Config(tmp_path / "instance")))

    return arrive


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    return tmp_path / "instance"


def kinds_of_pages(visitor: Visitor, forms: dict[str, dict[str, str]], limit: int = 40) -> list[str]:
    """Go all the way, with a form for each kind of page; return the kinds in order."""
    kinds: list[str] = []
    for _ in range(limit):
        place = visitor.place()
        if not place.startswith("/study/"):
            return kinds
        page = visitor.get(place)
        kind = re.search(r'<body data-page="(\w+)"', page.text)
        assert kind is not None
        kinds.append(kind[1])
        nonce = {"nonce": hidden_nonce(page)}
        if kind[1] in {"practice", "first_drive", "drive"}:
            answer = visitor.post(f"{place}/action", {"action": "give_up", "step": "1"} | nonce)
        else:
            answer = visitor.post(place, forms.get(kind[1], {}) | nonce)
        assert answer.status_code == 303, answer.text
    raise AssertionError("the study has no end")


RATED = {"rating-likeliness": "4", "rating-general": "2", "rating-check-a": "2", "rating-check-b": "1"}
FORMS = {
    "background": BACKGROUND_ANSWERS,
    "quiz": RIGHT,
    "rating": RATED,
    "satisfaction": {f"rating-{item}": "3" for item in SATISFACTION_ITEMS},
    "probe": {"predict-1": "forward", "rating-confidence-1": "5"},
}


def test_sections_that_are_left_out_leave_no_page(visit: Visit) -> None:
    visitor = visit(experiments=one_experiment(["subgoals"]))
    visitor.agree()
    assert kinds_of_pages(visitor, FORMS) == ["instructions", "situation", "rating"]


@pytest.mark.parametrize("when", ["before_ratings", "after_ratings"])
def test_everything_comes_in_its_place(visit: Visit, when: str) -> None:
    visitor = visit(
        background=BACKGROUND,
        practice={"layout": "simulation"},
        quiz=QUIZ,
        experiments=one_experiment(
            ["tailored_all"], drive={"when": when}, probe={"num_questions": 1}, satisfaction=True
        ),
    )
    visitor.agree()
    before = ["background", "instructions", "practice", "quiz", "situation", "first_drive"]
    rating = ["rating", "satisfaction"]
    last = ["explanation", "probe", "drive", *rating] if when == "before_ratings" else [*rating, "probe", "drive"]
    assert kinds_of_pages(visitor, FORMS) == [*before, *last]
    assert visitor.place() == "/done"


@pytest.mark.parametrize("baseline", [False, True])
def test_without_explanation_only_what_needs_none_is_asked(visit: Visit, instance: Path, *, baseline: bool) -> None:
    visitor = visit(experiments=one_experiment(["none"], drive={"baseline": baseline}, satisfaction=True))
    visitor.agree()
    page = visitor.post("/study/1", {"nonce": visitor.nonce(1)})
    assert page.status_code == 303
    kinds = kinds_of_pages(visitor, FORMS | {"rating": {"rating-likeliness": "3"}})
    assert kinds == ["situation", *(["first_drive"] if baseline else []), "rating", "drive"]
    assert ask(instance, "SELECT item, rating FROM ratings") == [("likeliness", 3)]


class TestAge:
    def test_the_declared_age_is_what_people_agree_to(self, visit: Visit) -> None:
        page = visit(consent={"minimum_age": 21}).get("/").text
        assert "I am at least 21 years old" in page
        assert "guardian" not in page

    @pytest.mark.parametrize(("group", "stored"), [("adult", 0), ("guardian", 1)])
    def test_a_guardians_consent_is_asked_for_and_stored(
        self, visit: Visit, instance: Path, group: str, stored: int
    ) -> None:
        visitor = visit(consent={"minimum_age": 12, "guardian_below": 18})
        nonce = hidden_nonce(visitor.get("/"))
        refused = visitor.post("/consent", {"agree": "yes", "nonce": nonce})
        assert refused.status_code == 422
        assert "Choose how old you are" in refused.text
        assert num_rows(instance, "participants") == 0
        assert visitor.post("/consent", {"agree": "yes", "age_group": group, "nonce": nonce}).status_code == 303
        assert ask(instance, "SELECT guardian_agreed FROM participants") == [(stored,)]


class TestBackground:
    def test_answers_are_stored_as_they_were_given(self, visit: Visit, instance: Path) -> None:
        visitor = visit(background=BACKGROUND)
        visitor.agree()
        assert visitor.post("/study/1", BACKGROUND_ANSWERS | {"nonce": visitor.nonce(1)}).status_code == 303
        rows = ask(instance, "SELECT question, purpose, answer, is_correct FROM answers ORDER BY question")
        assert rows == [
            ("age", "background", "33", None),
            ("gender", "background", "another", None),
            ("robots", "background", "I built one, once.", None),
        ]

    def test_everybody_may_prefer_not_to_say(self, visit: Visit, instance: Path) -> None:
        visitor = visit(background=BACKGROUND)
        visitor.agree()
        silent = {"refuse-age": "yes", "answer-gender": "prefer_not_to_say", "refuse-robots": "yes"}
        assert visitor.post("/study/1", silent | {"nonce": visitor.nonce(1)}).status_code == 303
        assert set(ask(instance, "SELECT answer FROM answers")) == {("prefer_not_to_say",)}

    @pytest.mark.parametrize("age", ["15", "121", "-3", "thirty", "3.5", "9999999999"])
    def test_an_impossible_age_is_pointed_out_and_nothing_typed_is_lost(
        self, visit: Visit, instance: Path, age: str
    ) -> None:
        visitor = visit(background=BACKGROUND)
        visitor.agree()
        page = visitor.post("/study/1", BACKGROUND_ANSWERS | {"answer-age": age, "nonce": visitor.nonce(1)})
        assert page.status_code == 422
        assert "That is no possible answer: How old are you" in page.text
        assert f'value="{age}"' in page.text
        assert "I built one, once." in page.text
        assert num_rows(instance, "answers") == num_rows(instance, "pages") == 0

    def test_the_field_says_how_much_fits(self, visit: Visit) -> None:
        visitor = visit(background=BACKGROUND)
        visitor.agree()
        assert 'maxlength="500"' in visitor.get("/study/1").text

    def test_words_that_are_too_long_are_refused_and_kept(self, visit: Visit, instance: Path) -> None:
        visitor = visit(background=BACKGROUND)
        visitor.agree()
        page = visitor.post("/study/1", BACKGROUND_ANSWERS | {"answer-robots": "x" * 501, "nonce": visitor.nonce(1)})
        assert page.status_code == 422
        assert "x" * 501 in page.text
        assert num_rows(instance, "answers") == 0


class TestQuiz:
    def begin(self, visit: Visit, **settings: Any) -> Visitor:  # noqa: ANN401
        visitor = visit(quiz=QUIZ | settings)
        visitor.agree()
        visitor.post("/study/1", {"nonce": visitor.nonce(1)})
        assert visitor.place() == "/study/2"
        return visitor

    def test_right_answers_lead_on(self, visit: Visit, instance: Path) -> None:
        visitor = self.begin(visit)
        assert visitor.post("/study/2", RIGHT | {"nonce": visitor.nonce(2)}).headers["Location"] == "/study/3"
        assert ask(instance, "SELECT attempt, is_correct FROM answers") == [(1, 1), (1, 1)]

    def test_a_wrong_answer_gets_feedback_and_another_try(self, visit: Visit, instance: Path) -> None:
        visitor = self.begin(visit)
        assert visitor.post("/study/2", WRONG | {"nonce": visitor.nonce(2)}).headers["Location"] == "/study/2"
        page = visitor.get("/study/2").text
        assert "the agent heads for the goal" in page
        assert "This is your last try." in page
        assert re.search(r'id="answer-door-2"[^>]* checked', page)
        assert not re.search(r'id="answer-goal-\d"[^>]* checked', page)
        visitor.post("/study/2", RIGHT | {"nonce": visitor.nonce(2)})
        rows = ask(instance, "SELECT attempt, question, is_correct FROM answers ORDER BY attempt, question")
        assert rows == [(1, "door", 1), (1, "goal", 0), (2, "door", 1), (2, "goal", 1)]

    def test_a_try_that_is_sent_twice_uses_up_one(self, visit: Visit, instance: Path) -> None:
        visitor = self.begin(visit)
        form = WRONG | {"nonce": visitor.nonce(2)}
        visitor.post("/study/2", form)
        assert visitor.post("/study/2", form).headers["Location"] == "/study/2"
        assert "your first answer stands" in visitor.get("/study/2").text
        assert ask(instance, "SELECT max(attempt) FROM answers") == [(1,)]

    def test_after_the_last_try_the_study_goes_on_if_it_says_so(self, visit: Visit, instance: Path) -> None:
        visitor = self.begin(visit)
        for _ in range(2):
            visitor.post("/study/2", WRONG | {"nonce": visitor.nonce(2)})
        assert visitor.place() == "/study/3"
        assert "Not every answer was right" in visitor.get("/study/3").text
        assert ask(instance, "SELECT screened_out_at FROM participants") == [(None,)]

    def test_or_it_ends_kindly_and_for_good(self, visit: Visit, instance: Path) -> None:
        visitor = self.begin(visit, on_failure="screen_out", attempts=1)
        assert visitor.post("/study/2", WRONG | {"nonce": visitor.nonce(2)}).headers["Location"] == "/ended"
        assert "The study ends here" in visitor.get("/ended").text
        assert visitor.place() == "/ended"
        assert visitor.get("/study/3").headers["Location"] == "/ended"
        visitor.post("/leave")
        assert ask(instance, "SELECT withdrawn_at, completed_at FROM participants") == [(None, None)]

    def test_an_unanswered_question_uses_up_no_try(self, visit: Visit, instance: Path) -> None:
        visitor = self.begin(visit)
        page = visitor.post("/study/2", {"answer-goal": "flag", "nonce": visitor.nonce(2)})
        assert page.status_code == 422
        assert re.search(r'id="answer-goal-2"[^>]* checked', page.text)
        assert num_rows(instance, "answers") == 0


class TestAttentionChecks:
    def test_they_look_like_ratings_and_are_kept_apart_from_them(self, visit: Visit, instance: Path) -> None:
        visitor = visit(experiments=one_experiment(["subgoals"]), attention_checks=CHECKS)
        visitor.agree()
        assert kinds_of_pages(visitor, FORMS) == ["instructions", "situation", "rating"]
        rows = ask(instance, "SELECT question, purpose, answer, is_correct FROM answers ORDER BY question")
        assert rows == [("check-a", "attention", "2", 1), ("check-b", "attention", "1", 0)]
        assert {item for (item,) in ask(instance, "SELECT item FROM ratings")} == {"likeliness", "general"}
        assert visitor.place() == "/done"

    def test_the_item_itself_says_what_to_choose(self, visit: Visit) -> None:
        visitor = visit(experiments=one_experiment(["subgoals"]), attention_checks=CHECKS)
        visitor.agree()
        visitor.post("/study/1", {"nonce": visitor.nonce(1)})
        visitor.post("/study/2", {"nonce": visitor.nonce(2)})
        page = visitor.get("/study/3").text
        assert "Please choose 2, whatever you think." in page
        assert "Please choose 4, whatever you think." in page

    def test_one_that_is_left_out_is_pointed_out(self, visit: Visit, instance: Path) -> None:
        visitor = visit(experiments=one_experiment(["subgoals"]), attention_checks=CHECKS)
        visitor.agree()
        visitor.walk(1, 2)
        form = {"rating-likeliness": "4", "rating-general": "2", "rating-check-a": "2"}
        page = visitor.post("/study/3", form | {"nonce": visitor.nonce(3)})
        assert page.status_code == 422
        assert 'href="#rating-check-b-1"' in page.text
        assert num_rows(instance, "ratings") == num_rows(instance, "answers") == 0


def test_the_satisfaction_scale_has_nine_items_with_a_label_each(visit: Visit, instance: Path) -> None:
    visitor = visit(experiments=one_experiment(["subgoals"], satisfaction=True))
    visitor.agree()
    visitor.walk(1, 2)
    visitor.post("/study/3", RATED | {"nonce": visitor.nonce(3)})
    page = visitor.get("/study/4").text
    assert len(re.findall(r"<legend", page)) == 9
    assert page.count("I am neutral about it") == 9
    form = {f"rating-{item}": "5" for item in SATISFACTION_ITEMS} | {"nonce": visitor.nonce(4)}
    assert visitor.post("/study/4", form).headers["Location"] == "/done"
    items = {item for (item,) in ask(instance, "SELECT item FROM ratings WHERE rating = 5")}
    assert items == set(SATISFACTION_ITEMS)


class TestPlacebicArm:
    STUDY: ClassVar[dict[str, Any]] = {
        "experiments": one_experiment(["placebic"]),
        "debriefing": {"discloses": ["placebic"]},
    }

    def test_it_is_disclosed_at_the_end_and_not_before(self, visit: Visit) -> None:
        visitor = visit(**self.STUDY)
        visitor.agree()
        visitor.walk(1, 2)
        assert "explain nothing on purpose" not in visitor.get("/study/3").text
        visitor.post("/study/3", RATED | {"nonce": visitor.nonce(3)})
        assert "explain nothing on purpose" in visitor.get("/done").text

    def test_it_is_disclosed_to_those_who_leave_too(self, visit: Visit) -> None:
        visitor = visit(**self.STUDY)
        visitor.agree()
        visitor.post("/leave")
        assert "explain nothing on purpose" in visitor.get("/left").text


def test_predictions_are_scored_from_the_policy(visit: Visit, instance: Path) -> None:
    visitor = visit(experiments=one_experiment(["subgoals"], probe={"num_questions": 2}))
    visitor.agree()
    visitor.walk(1, 2)
    visitor.post("/study/3", RATED | {"nonce": visitor.nonce(3)})
    form = {"predict-1": "left", "predict-2": "pickup", "time-predict-1": "1234"}
    page = visitor.post("/study/4", form | {"rating-confidence-1": "5", "nonce": visitor.nonce(4)})
    assert page.status_code == 422
    assert 'href="#rating-confidence-2-1"' in page.text
    assert re.search(r'id="predict-1-2"[^>]* checked', page.text)
    assert num_rows(instance, "predictions") == 0
    form |= {"rating-confidence-1": "5", "rating-confidence-2": "1", "nonce": visitor.nonce(4)}
    assert visitor.post("/study/4", form).headers["Location"] == "/done"
    query = "SELECT question, predicted, action, is_correct, confidence, response_time_ms FROM predictions"
    assert ask(instance, query) == [(1, "left", "left", 1, 5, 1234), (2, "pickup", "left", 0, 1, None)]


class TestEvents:
    LOG = (
        '[["painted","","",0],["changed","likeliness","4",812],["attended","1","300 pointer",900],'
        '["no_such_event","","",1],["changed","likeliness",5,-1],"nonsense"]'
    )

    def send(self, visit: Visit, log: str, **sections: Any) -> None:  # noqa: ANN401
        visitor = visit(experiments=one_experiment(["subgoals"]), **sections)
        visitor.agree()
        visitor.walk(1, 2)
        form = RATED | {"nonce": visitor.nonce(3), "events": log}
        assert visitor.post("/study/3", form).headers["Location"] == "/done"

    def test_times_are_always_kept_and_looking_only_where_the_consent_says_so(
        self, visit: Visit, instance: Path
    ) -> None:
        self.send(visit, self.LOG)
        rows = ask(instance, "SELECT event, target, value, at_ms FROM events ORDER BY number")
        assert rows == [("painted", "", "", 0), ("changed", "likeliness", "4", 812)]

    def test_with_the_section_looking_is_kept_and_the_consent_says_so(self, visit: Visit, instance: Path) -> None:
        self.send(visit, self.LOG, behaviour_log={})
        assert ("attended", "1", "300 pointer") in ask(instance, "SELECT event, target, value FROM events")

    @pytest.mark.parametrize("log", ["{", "[" * 5000, "7", '{"a": 1}', '[["painted"]]', "[" + "1," * 3000 + "1]"])
    def test_no_answer_is_refused_for_its_log(self, visit: Visit, instance: Path, log: str) -> None:
        self.send(visit, log)
        assert num_rows(instance, "events") == 0
        assert num_rows(instance, "ratings") == 2

    @pytest.mark.parametrize("declared", [False, True])
    def test_the_consent_declares_what_is_logged(self, visit: Visit, *, declared: bool) -> None:
        page = visit(behaviour_log={} if declared else None).get("/").text
        assert ("which pictures you look at" in page) is declared
        assert ("data-behaviour" in page) is declared


def test_a_script_is_told_where_to_go_and_a_browser_is_sent_there(visit: Visit) -> None:
    visitor = visit(experiments=one_experiment(["subgoals"]))
    visitor.agree()
    form = filled(1, visitor.nonce(1))
    headers = {"Sec-Fetch-Site": "same-origin", "Accept": "application/json"}
    answer = visitor.client.post("/study/1", data=form, headers=headers)
    assert (answer.status_code, answer.json) == (200, {"next": "/study/2"})
    again = visitor.client.post("/study/1", data=form, headers=headers)
    assert again.json == {"next": "/study/2"}
    assert "your first answer stands" in visitor.get("/study/2").text
