"""Double clicks, the back button, two tabs, old and foreign forms: what was stored first stands, and is told."""

import re
import threading
from pathlib import Path

import pytest
from flask import Flask

from tests.web.people import NUM_PAGES, SAME_SITE, Visitor, filled
from tests.web.reading import num_rows, stored_ratings

ALREADY = "your first answer stands"
TOO_EARLY = "That page comes later"
STALE = "belonged to another page"


def notice(visitor: Visitor) -> str:
    """What the page that the visitor is taken to has to say."""
    found = re.search(r'class="notice".*?<p>(.*?)</p>', visitor.get(visitor.place()).text, flags=re.DOTALL)
    return "" if found is None else found[1]


@pytest.fixture
def visitor(app: Flask) -> Visitor:
    """A participant at page 4, who has rated one explanation."""
    somebody = Visitor(app)
    somebody.agree()
    somebody.walk(last=3)
    return somebody


def test_a_page_sent_twice_keeps_the_first_answer_and_says_so(visitor: Visitor, instance: Path) -> None:
    visitor.answer(4)
    form = filled(5, visitor.nonce(5), rating_general="2")
    assert visitor.post("/study/5", form).headers["Location"] == "/study/6"
    again = visitor.post("/study/5", form | {"rating-general": "5"})
    assert (again.status_code, again.headers["Location"]) == (303, "/study/6")
    assert ALREADY in notice(visitor)
    assert notice(visitor) == ""
    assert stored_ratings(instance)[1, 5]["general"] == 2


def test_the_first_sending_has_no_notice(visitor: Visitor) -> None:
    visitor.answer(4)
    assert notice(visitor) == ""


def test_an_answered_page_sent_again_empty_is_no_mistake_to_mend(visitor: Visitor, instance: Path) -> None:
    nonce = visitor.nonce(4)
    visitor.post("/study/4", {"nonce": nonce})
    visitor.walk(5, 5)
    before = stored_ratings(instance)
    form = {"nonce": re.sub(".", "0", nonce)}
    assert visitor.post("/study/5", form).headers["Location"] == "/study/6"
    assert stored_ratings(instance) == before


def test_the_back_button_leads_forward_again_with_a_notice(visitor: Visitor) -> None:
    assert visitor.get("/study/3").headers["Location"] == "/study/4"
    assert ALREADY in notice(visitor)


def test_nothing_is_skipped(visitor: Visitor, instance: Path) -> None:
    nonce = visitor.nonce(4)
    for number in range(5, NUM_PAGES + 1):
        assert visitor.get(f"/study/{number}").headers["Location"] == "/study/4"
        assert TOO_EARLY in notice(visitor)
        assert visitor.post(f"/study/{number}", filled(number, nonce)).headers["Location"] == "/study/4"
        assert TOO_EARLY in notice(visitor)
    assert visitor.get("/done").headers["Location"] == "/study/4"
    assert num_rows(instance, "pages") == 3


def test_a_form_of_another_participant_is_not_stored(visitor: Visitor, app: Flask, instance: Path) -> None:
    other = Visitor(app)
    other.agree()
    other.walk(last=3)
    for nonce in (other.nonce(4), "", "ü", "0" * 32, visitor.nonce(4)[:-1]):
        assert visitor.post("/study/4", {"nonce": nonce}).headers["Location"] == "/study/4"
        assert STALE in notice(visitor)
    assert num_rows(instance, "pages") == 6


def test_a_page_left_open_by_an_earlier_visitor_of_the_same_browser_is_not_stored(
    visitor: Visitor, instance: Path
) -> None:
    old = filled(4, visitor.nonce(4))
    visitor.post("/leave")
    visitor.agree()
    visitor.walk(last=3)
    assert visitor.post("/study/4", old).headers["Location"] == "/study/4"
    assert STALE in notice(visitor)
    assert num_rows(instance, "pages") == 6


def test_of_two_tabs_the_first_to_send_counts(visitor: Visitor, instance: Path) -> None:
    visitor.answer(4)
    first_tab = filled(5, visitor.nonce(5), rating_likeliness="1")
    second_tab = filled(5, visitor.nonce(5), rating_likeliness="5")
    visitor.post("/study/5", second_tab)
    visitor.post("/study/5", first_tab)
    assert ALREADY in notice(visitor)
    visitor.walk(6)
    assert stored_ratings(instance)[1, 5]["likeliness"] == 5
    assert num_rows(instance, "ratings") == 15


def test_the_last_page_sent_twice_ends_at_the_thanks_with_a_notice(visitor: Visitor, instance: Path) -> None:
    visitor.walk(4, 10)
    form = filled(11, visitor.nonce(11))
    for _ in range(2):
        assert visitor.post("/study/11", form).headers["Location"] == "/done"
    assert ALREADY in notice(visitor)
    assert num_rows(instance, "ratings") == 15


def test_a_button_pressed_many_times_at_once_stores_one_page(visitor: Visitor, instance: Path) -> None:
    visitor.answer(4)
    nonce, token = visitor.nonce(5), visitor.client.get_cookie("participant")
    assert token is not None
    barrier, answers = threading.Barrier(10), []

    def press(rating: str) -> None:
        client = visitor.app.test_client()
        client.set_cookie("participant", token.value)
        form = filled(5, nonce, rating_likeliness=rating, rating_loveliness=rating, rating_general=rating)
        barrier.wait()
        answers.append(client.post("/study/5", data=form, headers=SAME_SITE).headers["Location"])

    threads = [threading.Thread(target=press, args=(str(1 + number % 5),)) for number in range(10)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == ["/study/6"] * 10
    stored = stored_ratings(instance)[1, 5]
    assert len(stored) == 3
    assert len(set(stored.values())) == 1


def test_going_back_from_the_end_leads_to_the_end_without_a_notice(visitor: Visitor) -> None:
    visitor.walk(4)
    assert visitor.get("/study/11").headers["Location"] == "/done"
    assert notice(visitor) == ""


def test_the_farewell_has_no_notice(visitor: Visitor) -> None:
    form = filled(4, visitor.nonce(4))
    visitor.post("/leave")
    for answer in (visitor.get("/study/4"), visitor.post("/study/4", form), visitor.post("/study/9", form)):
        assert answer.headers["Location"] == "/left"
        assert notice(visitor) == ""
