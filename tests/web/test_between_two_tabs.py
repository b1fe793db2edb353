"""What happens in another tab between the look at a form and its storing decides, and is told."""

from collections.abc import Callable
from typing import Any

import pytest
from flask import Flask

from tests.web.people import Visitor, filled
from tests.web.test_sending_again import notice
from webapp.storage.answers import store_page
from webapp.views import participant as view

ALREADY = "You had already sent that page"
LATER = "That page comes later"


@pytest.fixture
def visitor(app: Flask) -> Visitor:
    somebody = Visitor(app)
    somebody.agree()
    return somebody


@pytest.fixture
def meanwhile(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], object]], None]:
    """Let something happen once, after the next form was looked at and before it is stored."""

    def arrange(action: Callable[[], object]) -> None:
        def act_first(*given: Any) -> Any:  # noqa: ANN401
            monkeypatch.setattr(view, "store_page", store_page)
            action()
            return store_page(*given)

        monkeypatch.setattr(view, "store_page", act_first)

    return arrange


def other_tab(visitor: Visitor) -> Visitor:
    """Another tab of the same browser, whose notices are its own."""
    tab = Visitor(visitor.app)
    cookie = visitor.client.get_cookie("participant")
    assert cookie is not None
    tab.client.set_cookie("participant", cookie.value)
    return tab


def test_a_page_that_another_tab_sends_in_between_is_that_tabs(
    visitor: Visitor, meanwhile: Callable[[Callable[[], object]], None]
) -> None:
    visitor.walk(1, 2)
    form = filled(3, visitor.nonce(3))
    tab = other_tab(visitor)
    meanwhile(lambda: tab.post("/study/3", form))
    answer = visitor.post("/study/3", form)
    assert (answer.status_code, answer.headers["Location"]) == (303, "/study/4")
    assert ALREADY in notice(visitor)
    assert notice(tab) == ""


def test_who_leaves_in_another_tab_in_between_is_gone_and_hears_no_reproach(
    visitor: Visitor, meanwhile: Callable[[Callable[[], object]], None]
) -> None:
    form = filled(1, visitor.nonce(1))
    meanwhile(lambda: other_tab(visitor).post("/leave"))
    answer = visitor.post("/study/1", form)
    assert (answer.status_code, answer.headers["Location"]) == (303, "/left")
    with visitor.client.session_transaction() as session:
        assert "_flashes" not in session


def test_who_has_left_is_led_to_the_farewell_without_a_notice_whatever_they_send(visitor: Visitor) -> None:
    form = filled(1, visitor.nonce(1))
    visitor.post("/leave")
    answer = visitor.post("/study/1", form)
    assert (answer.status_code, answer.headers["Location"]) == (303, "/left")
    with visitor.client.session_transaction() as session:
        assert "_flashes" not in session


def test_going_back_or_ahead_is_told_apart(visitor: Visitor) -> None:
    visitor.walk(1, 3)
    for number, words in ((3, ALREADY), (5, LATER), (1, ALREADY), (11, LATER)):
        answer = visitor.get(f"/study/{number}")
        assert (answer.status_code, answer.headers["Location"]) == (303, "/study/4")
        assert words in notice(visitor)
    assert visitor.get("/study/4").status_code == 200
    assert notice(visitor) == ""


def test_a_mistake_to_mend_is_an_error_of_the_form(visitor: Visitor) -> None:
    visitor.walk(1, 2)
    answer = visitor.post("/study/3", {"nonce": visitor.nonce(3)})
    assert answer.status_code == 422


@pytest.mark.parametrize("path", ["/left", "/ended", "/done"])
def test_an_end_is_shown_to_nobody_who_is_still_on_the_way(visitor: Visitor, path: str) -> None:
    answer = visitor.get(path)
    assert (answer.status_code, answer.headers["Location"]) == (303, "/study/1")


def test_a_picture_that_was_never_made_is_not_found(visitor: Visitor) -> None:
    assert visitor.get(f"/pictures/{'a' * 64}.png").status_code == 404


def test_a_script_is_told_where_to_go_and_a_browser_is_led_there(visitor: Visitor) -> None:
    told = visitor.client.get("/study", headers={"Accept": "application/json"})
    assert (told.status_code, told.get_json()) == (200, {"next": "/study/1"})
    for accepted in ("text/html", "*/*", "text/html, application/json;q=0.9"):
        led = visitor.client.get("/study", headers={"Accept": accepted})
        assert (led.status_code, led.headers["Location"]) == (303, "/study/1")
