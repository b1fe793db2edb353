"""Recruiters' links, personal links and languages: checked, taken out of the address, remembered, never mixed up."""

import html
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from flask import Flask

from tests.web.bundles import FILLED_IN, write_bundle
from tests.web.people import Visitor
from tests.web.reading import ask, num_rows
from tests.web.studies import PROLIFIC, QUIZ, WRONG, a_study, one_experiment
from webapp.config import Config

PERSON = "5f1e2d3c4b5a69788796a5b4"
LINK = f"/?PROLIFIC_PID={PERSON}&STUDY_ID={'a' * 24}&SESSION_ID={'b' * 24}"
RATED = {"rating-likeliness": "4", "rating-general": "2"}


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    return tmp_path / "instance"


@pytest.fixture
def app(instance: Path, start_app: Callable[[Config], Flask]) -> Callable[..., Flask]:
    def start(*, live: bool = False, **sections: Any) -> Flask:  # noqa: ANN401
        sections = {"recruitment": PROLIFIC, "experiments": one_experiment(["subgoals"])} | sections
        write_bundle(instance, a_study(**sections, **FILLED_IN))
        return start_app(Config(instance, live=live))

    return start


def complete(visitor: Visitor) -> None:
    for number in (1, 2, 3):
        assert visitor.post(f"/study/{number}", RATED | {"nonce": visitor.nonce(number)}).status_code == 303


class TestProlific:
    def test_the_ids_leave_the_address_at_once_and_are_kept_apart(
        self, app: Callable[..., Flask], instance: Path
    ) -> None:
        visitor = Visitor(app())
        assert visitor.get(LINK).headers["Location"] == "/"
        assert PERSON not in visitor.get("/").text
        assert num_rows(instance, "recruits") == 0
        visitor.agree()
        row = ("prolific", PERSON, "a" * 24, "b" * 24)
        query = "SELECT service, external_id, external_study, external_session FROM recruits"
        assert ask(instance, query) == [row]

    def test_the_code_is_shown_only_at_the_end(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app())
        visitor.get(LINK)
        visitor.agree()
        for number in (1, 2, 3):
            assert "DONE1" not in visitor.get(f"/study/{number}").text
            assert visitor.get("/done").headers["Location"] == f"/study/{number}"
            visitor.post(f"/study/{number}", RATED | {"nonce": visitor.nonce(number)})
        page = html.unescape(visitor.get("/done").text)
        assert "<code>DONE1</code>" in page
        assert f'href="https://recruiter.example/done?cc=DONE1&pid={PERSON}"' in page

    def test_who_leaves_gets_a_code_too(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app())
        visitor.get(LINK)
        visitor.agree()
        visitor.post("/leave")
        page = visitor.get("/left").text
        assert "<code>LEFT4</code>" in page
        assert "DONE1" not in page

    def test_so_does_who_does_not_take_part_and_nothing_is_kept(
        self, app: Callable[..., Flask], instance: Path
    ) -> None:
        visitor = Visitor(app())
        visitor.get(LINK)
        page = visitor.get("/declined").text
        assert "<code>NO333</code>" in page
        assert 'href="https://recruiter.example/no?cc=NO333"' in page
        assert num_rows(instance, "participants") == num_rows(instance, "recruits") == 0

    def test_and_who_is_screened_out(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app(quiz=QUIZ | {"attempts": 1, "on_failure": "screen_out"}))
        visitor.get(LINK)
        visitor.agree()
        visitor.post("/study/1", {"nonce": visitor.nonce(1)})
        visitor.post("/study/2", WRONG | {"nonce": visitor.nonce(2)})
        page = visitor.get("/ended").text
        assert "<code>OUT22</code>" in page
        assert "DONE1" not in page

    def test_the_same_link_leads_back_to_the_same_place_on_another_device(
        self, app: Callable[..., Flask], instance: Path
    ) -> None:
        flask = app()
        first, second = Visitor(flask), Visitor(flask)
        first.get(LINK)
        first.agree()
        first.post("/study/1", {"nonce": first.nonce(1)})
        assert second.get(LINK).headers["Location"] == "/study/2"
        assert second.get("/study/2").status_code == 200
        assert num_rows(instance, "participants") == 1

    def test_two_tabs_that_agree_make_one_participant(self, app: Callable[..., Flask], instance: Path) -> None:
        flask = app()
        first, second = Visitor(flask), Visitor(flask)
        for visitor in (first, second):
            visitor.get(LINK)
        first.agree()
        assert second.agree().headers["Location"] == "/study/1"
        assert num_rows(instance, "participants") == 1

    def test_another_submission_of_the_same_person_is_told_so(self, app: Callable[..., Flask], instance: Path) -> None:
        flask = app()
        first, second = Visitor(flask), Visitor(flask)
        first.get(LINK)
        first.agree()
        second.get(LINK.replace("b" * 24, "c" * 24))
        answer = second.agree()
        assert answer.status_code == 409
        assert "You take part already" in answer.text
        assert num_rows(instance, "participants") == 1

    @pytest.mark.parametrize(
        ("link", "message"),
        [
            (LINK.replace(PERSON, "{{%PROLIFIC_PID%}}"), "PROLIFIC_PID is “{{”"),
            (LINK.replace(PERSON, "short"), "PROLIFIC_PID is “short”; it should be 24 characters"),
            (LINK.split("&", maxsplit=1)[0], "The link lacks: STUDY_ID"),
            (f"/?STUDY_ID={'a' * 24}", "The link lacks: PROLIFIC_PID"),
            (LINK.replace(PERSON, "<script>"), "“<script>”"),
        ],
    )
    def test_a_broken_link_is_told_and_lets_nobody_in(
        self, app: Callable[..., Flask], instance: Path, link: str, message: str
    ) -> None:
        visitor = Visitor(app())
        answer = visitor.get(link)
        assert answer.status_code == 400
        assert "<script>" not in answer.text
        assert message.split("”", maxsplit=1)[0] in html.unescape(answer.text)
        visitor.agree()
        assert num_rows(instance, "recruits") == 0

    def test_in_a_live_study_nobody_gets_in_without_the_link(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = Visitor(app(live=True))
        answer = visitor.get("/")
        assert answer.status_code == 400
        assert "The link lacks: PROLIFIC_PID" in answer.text
        assert visitor.post("/consent", {"agree": "yes"}).status_code == 400
        assert num_rows(instance, "participants") == 0
        visitor.get(LINK)
        assert visitor.agree().headers["Location"] == "/study/1"

    def test_the_consent_says_what_the_service_told(self, app: Callable[..., Flask]) -> None:
        assert "apart from your answers" in Visitor(app()).get("/").text
        assert "apart from your answers" not in Visitor(app(recruitment=None)).get("/").text


@pytest.mark.parametrize(
    ("service", "link", "external_id"), [("sona", "/?id=4711", "4711"), ("label", "/?label=Lab_3-b", "Lab_3-b")]
)
def test_other_recruiters_and_plain_labels(
    app: Callable[..., Flask], instance: Path, service: str, link: str, external_id: str
) -> None:
    visitor = Visitor(app(recruitment={"service": service}))
    visitor.get(link)
    visitor.agree()
    assert ask(instance, "SELECT service, external_id FROM recruits") == [(service, external_id)]
    complete(visitor)
    assert "completion code" not in visitor.get("/done").text


def test_a_recruiters_link_means_nothing_to_a_study_without_recruiter(
    app: Callable[..., Flask], instance: Path
) -> None:
    visitor = Visitor(app(recruitment=None))
    assert visitor.get(LINK).headers["Location"] == "/"
    visitor.agree()
    assert num_rows(instance, "recruits") == 0


class TestPersonalLink:
    def link_of(self, visitor: Visitor) -> str:
        found = re.search(r"<code>http://localhost(/resume/[0-9a-f]{64})</code>", visitor.get("/another-device").text)
        assert found is not None
        return found[1]

    def test_it_leads_to_the_same_place_on_another_device(self, app: Callable[..., Flask]) -> None:
        flask = app(recruitment=None)
        first, second = Visitor(flask), Visitor(flask)
        first.agree()
        first.post("/study/1", {"nonce": first.nonce(1)})
        link = self.link_of(first)
        assert "Go on with the study on this device?" in second.get(link).text
        assert second.get("/study").status_code == 403
        assert second.post(link).headers["Location"] == "/study/2"
        second.post("/study/2", {"nonce": second.nonce(2)})
        assert first.place() == "/study/3"

    @pytest.mark.parametrize("token", ["0" * 64, "x", "..%2f"])
    def test_another_link_leads_nowhere(self, app: Callable[..., Flask], token: str) -> None:
        answer = Visitor(app()).get(f"/resume/{token}")
        assert answer.status_code in {403, 404}

    def test_a_stranger_has_none(self, app: Callable[..., Flask]) -> None:
        assert Visitor(app()).get("/another-device").status_code == 403


class TestLanguages:
    TWO = ("en", "ja")

    def test_the_link_decides_and_is_stored(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = Visitor(app(recruitment=None, languages=list(self.TWO)))
        assert visitor.get("/?lang=ja").headers["Location"] == "/"
        assert '<html lang="ja">' in visitor.get("/").text
        visitor.agree()
        assert ask(instance, "SELECT language, translation FROM participants") == [("ja", "unvalidated")]
        assert '<html lang="ja">' in visitor.get("/study/1").text

    @pytest.mark.parametrize(
        ("wish", "language"),
        [("ja,en;q=0.5", "ja"), ("en-GB,en", "en"), ("fr", "en"), ("de,ja;q=0.3", "ja"), ("", "en")],
    )
    def test_else_the_browser(self, app: Callable[..., Flask], wish: str, language: str) -> None:
        visitor = Visitor(app(recruitment=None, languages=list(self.TWO)))
        page = visitor.client.get("/", headers={"Accept-Language": wish})
        assert f'<html lang="{language}">' in page.text

    def test_the_participant_can_choose(self, app: Callable[..., Flask]) -> None:
        page = Visitor(app(recruitment=None, languages=list(self.TWO))).get("/").text
        assert re.search(r'<a href="/\?lang=ja" lang="ja" hreflang="ja">日本語</a>', page)
        assert re.search(r'<a href="/\?lang=en" lang="en" hreflang="en" aria-current="true">English</a>', page)

    def test_after_the_consent_the_language_stays(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app(recruitment=None, languages=list(self.TWO)))
        visitor.get("/?lang=ja")
        visitor.agree()
        visitor.get("/?lang=en")
        assert '<html lang="ja">' in visitor.get("/study/1").text

    def test_a_language_that_the_study_lacks_is_told(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app(recruitment=None))
        visitor.get("/?lang=tlh")
        assert "not available in the language of your link" in visitor.get("/").text

    def test_recruiter_and_language_come_in_one_link(self, app: Callable[..., Flask], instance: Path) -> None:
        visitor = Visitor(app(languages=list(self.TWO), translations={"ja": {"back_translation": "Report 7"}}))
        visitor.get(f"{LINK}&lang=ja")
        visitor.agree()
        assert ask(instance, "SELECT language, translation FROM participants") == [("ja", "back_translated")]
        assert num_rows(instance, "recruits") == 1


class TestOneBrowserForSeveralPeople:
    OTHER = LINK.replace(PERSON, "6" * 24).replace("b" * 24, "d" * 24)

    def test_the_next_persons_link_does_not_lead_into_the_last_persons_study(
        self, app: Callable[..., Flask], instance: Path
    ) -> None:
        visitor = Visitor(app(live=True))
        visitor.get(LINK)
        visitor.agree()
        assert visitor.get(self.OTHER).headers["Location"] == "/"
        assert visitor.get("/").status_code == 200
        visitor.agree()
        visitor.post("/study/1", {"nonce": visitor.nonce(1)})
        assert ask(instance, "SELECT external_id FROM recruits") == [(PERSON,), ("6" * 24,)]
        assert ask(instance, "SELECT participant_id FROM pages") == [(2,)]
        assert visitor.get(LINK).headers["Location"] == "/study/1"

    def test_who_has_finished_finds_the_code_again_and_no_second_consent(
        self, app: Callable[..., Flask], instance: Path
    ) -> None:
        visitor = Visitor(app(live=True))
        visitor.get(LINK)
        nonce = re.search(r'name="nonce" value="(\w+)"', visitor.get("/").text)
        assert nonce is not None
        visitor.agree()
        complete(visitor)
        assert visitor.get("/").headers["Location"] == "/done"
        assert visitor.get("/declined").headers["Location"] == "/done"
        assert visitor.post("/consent", {"agree": "yes", "nonce": nonce[1]}).headers["Location"] == "/done"
        assert num_rows(instance, "participants") == 1

    def test_a_study_without_recruiter_is_open_to_the_next_person(
        self, app: Callable[..., Flask], instance: Path
    ) -> None:
        visitor = Visitor(app(recruitment=None, languages=["en", "ja"]))
        visitor.get("/?lang=ja")
        visitor.agree()
        complete(visitor)
        visitor.get("/?lang=en")
        assert '<html lang="en">' in visitor.get("/").text
        visitor.agree()
        assert ask(instance, "SELECT language FROM participants") == [("ja",), ("en",)]

    def test_who_takes_part_cannot_decline_any_more_but_leave(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app(recruitment=None))
        visitor.agree()
        assert visitor.get("/declined").headers["Location"] == "/leave"

    def test_errors_lead_newcomers_to_the_first_page(self, app: Callable[..., Flask]) -> None:
        visitor = Visitor(app(recruitment=None))
        assert 'class="button" href="/"' in visitor.get("/no-such-page").text
        visitor.agree()
        assert 'class="button" href="/study"' in visitor.get("/no-such-page").text


def test_a_personal_link_speaks_the_participants_language(app: Callable[..., Flask]) -> None:
    flask = app(recruitment=None, languages=["en", "ja"])
    first, second = Visitor(flask), Visitor(flask)
    first.get("/?lang=ja")
    first.agree()
    link = re.search(r"(/resume/[0-9a-f]{64})", first.get("/another-device").text)
    assert link is not None
    assert '<html lang="ja">' in second.get(link[1]).text
    first.post("/leave")
    assert "この研究への参加は終わっています" in second.get(link[1]).text
    assert second.post(link[1]).headers["Location"] == "/left"
    assert first.get("/another-device").headers["Location"] == "/left"
