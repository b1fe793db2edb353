"""What impatient, unlucky and curious people do with a page: each gesture leaves exactly one row of every answer."""

import random
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Error, Page, Route, expect

from tests.browser.participant import Participant
from tests.browser.site import Row, Site
from tests.browser.windows import DESKTOP, OpenContext
from tests.web.reading import ask

Gesture = Callable[[Participant], None]

# What a browser says of a connection that a test cuts, or of a server that a test lets fail.
PROVOKED = ("ERR_INTERNET_DISCONNECTED", "ERR_FAILED", "503", "Failed to load resource", "422")


@pytest.fixture
def participant(site: Site, open_context: OpenContext) -> Iterator[Participant]:
    """A participant at the first rating page, with scripts."""
    page = open_context(expected=PROVOKED, **DESKTOP).new_page()
    participant = Participant(page, site, random.Random(1))
    participant.agree()
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    yield participant
    for opened in page.context.pages:
        opened.close()


def send_button(page: Page, participant: Participant) -> None:
    page.get_by_role("button", name=participant.site.texts("explanation.send")).click()


def double_click(participant: Participant) -> None:
    participant.answer_all(4)
    participant.button("explanation.send").dblclick()


def ten_clicks(participant: Participant) -> None:
    participant.answer_all(4)
    participant.page.evaluate(
        "for (let i = 0; i < 10; i++) document.querySelector('form.page-form .actions button').click()"
    )


def enter_held_down(participant: Participant) -> None:
    participant.answer_all(4)
    participant.button("explanation.send").focus()
    for _ in range(8):
        participant.page.keyboard.down("Enter")
    participant.page.keyboard.up("Enter")


def reload_while_it_is_being_sent(participant: Participant) -> None:
    participant.answer_all(4)
    participant.button("explanation.send").click(no_wait_after=True)
    try:
        participant.page.reload()
    except Error as problem:  # The page that follows came first, and took the place of the reload.
        if "ERR_ABORTED" not in problem.message:
            raise
        participant.page.wait_for_load_state()
    if participant.page.url.endswith("/study/3"):
        participant.answer_all(4)
        participant.send()


def two_tabs_that_both_send(participant: Participant) -> None:
    other = participant.page.context.new_page()
    other.goto("/study/3")
    for item in participant.items():
        other.locator(f"label[for='rating-{item}-1']").click()
    participant.answer_all(4)
    participant.send()
    send_button(other, participant)
    expect(other.get_by_text(participant.site.texts("notices.already_answered"))).to_be_visible()


def back_and_send_again(participant: Participant) -> None:
    participant.answer_all(4)
    participant.send()
    participant.page.go_back()
    if participant.page.url.endswith("/study/3"):
        participant.answer_all(1)
        participant.send()


def back_and_forward(participant: Participant) -> None:
    participant.answer_all(4)
    participant.send()
    participant.page.go_back()
    participant.page.go_forward()


def reload_after_sending(participant: Participant) -> None:
    participant.answer_all(4)
    participant.send()
    for _ in range(3):
        participant.page.reload()


def reload_of_a_page_that_came_back_with_errors(participant: Participant) -> None:
    first, *others = participant.items()
    participant.answer(first, 4)
    participant.button("explanation.send").click()
    expect(participant.page.locator(".error-summary")).to_be_visible()
    participant.page.reload()
    for item in others:
        participant.answer(item, 4)
    participant.send()


def away_and_back_from_the_cache(participant: Participant) -> None:
    participant.answer_all(4)
    participant.page.get_by_role("link", name=participant.site.texts("page.leave")).click()
    participant.page.wait_for_url("**/leave")
    participant.page.go_back()
    participant.page.wait_for_url("**/study/3")
    for item in participant.items():
        expect(participant.page.locator(f"#rating-{item}-4")).to_be_checked()
    participant.send()


def reload_before_sending(participant: Participant) -> None:
    participant.answer_all(4)
    participant.page.reload()
    for item in participant.items():
        expect(participant.page.locator(f"#rating-{item}-4")).to_be_checked()
    participant.send()


def lost_connection(participant: Participant) -> None:
    participant.answer_all(4)
    participant.page.context.set_offline(True)
    participant.button("explanation.send").click()
    expect(participant.page.locator(".sending-notice")).to_contain_text("no connection")
    participant.page.context.set_offline(False)


def many_presses_without_connection(participant: Participant) -> None:
    participant.answer_all(4)
    participant.page.context.set_offline(True)
    button = participant.page.locator("form.page-form .actions button")
    for _ in range(4):
        button.click()
    expect(participant.page.locator(".sending-notice")).to_be_visible()
    participant.page.context.set_offline(False)


def answer_that_got_lost_on_its_way_back(participant: Participant) -> None:
    """The server has stored the page, and the browser never hears of it."""
    lost: list[str] = []

    def lose_the_first(route: Route) -> None:
        if lost or route.request.method != "POST":
            route.fallback()
            return
        lost.append(route.request.url)
        route.fetch()
        route.abort()

    participant.page.route("**/study/3", lose_the_first)
    participant.answer_all(4)
    participant.button("explanation.send").click()


def server_that_is_busy_at_first(participant: Participant) -> None:
    refused: list[str] = []

    def refuse_the_first(route: Route) -> None:
        if refused or route.request.method != "POST":
            route.fallback()
            return
        refused.append(route.request.url)
        route.fulfill(status=503, body="busy")

    participant.page.route("**/study/3", refuse_the_first)
    participant.answer_all(4)
    participant.button("explanation.send").click()
    expect(participant.page.locator(".sending-notice")).to_be_visible()


def window_closed_while_it_is_being_sent(participant: Participant) -> None:
    participant.answer_all(4)
    context = participant.page.context
    with context.expect_event("requestfinished", lambda request: request.method == "POST"):
        participant.button("explanation.send").click(no_wait_after=True)
    participant.page.close()
    participant.page = context.new_page()
    participant.page.goto("/")


def address_typed_anew(participant: Participant) -> None:
    participant.answer_all(4)
    participant.send()
    participant.page.goto("/study/3")
    expect(participant.page.get_by_text(participant.site.texts("notices.already_answered"))).to_be_visible()


GESTURES: tuple[Gesture, ...] = (
    double_click,
    ten_clicks,
    enter_held_down,
    reload_while_it_is_being_sent,
    two_tabs_that_both_send,
    back_and_send_again,
    back_and_forward,
    reload_after_sending,
    reload_of_a_page_that_came_back_with_errors,
    away_and_back_from_the_cache,
    reload_before_sending,
    lost_connection,
    many_presses_without_connection,
    answer_that_got_lost_on_its_way_back,
    server_that_is_busy_at_first,
    window_closed_while_it_is_being_sent,
    address_typed_anew,
)


@pytest.mark.parametrize("gesture", GESTURES, ids=lambda gesture: gesture.__name__)
def test_each_gesture_leaves_exactly_one_row(participant: Participant, site: Site, gesture: Gesture) -> None:
    gesture(participant)
    participant.page.wait_for_url("**/study/4", timeout=20_000)
    last = max(site.export("participants.csv"), key=lambda row: row["consented_at"])
    rows: list[Row] = [row for row in site.export("ratings.csv") if row["participant"] == last["participant"]]
    expected = {item.id: "4" for item in site.catalogue.study.experiments[0].items}
    assert {row["item"]: row["rating"] for row in rows} == expected
    assert len(rows) == len(expected)
    assert last["num_pages_sent"] == "3"
    (count,) = ask(
        site.instance,
        "SELECT count(*) FROM pages JOIN participants ON id = participant_id WHERE code = ?",
        last["participant"],
    )
    assert count == (3,)
