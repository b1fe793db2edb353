"""Sending in the background: what is answered arrives once, however the network and the person behave."""

import threading
import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.small_site import Reply, Sent, SmallSite, go_on, items, markup, serve_small
from tests.browser.windows import DESKTOP, OpenContext

LOST = ("503", "ERR_INTERNET_DISCONNECTED", "ERR_FAILED", "ERR_CONNECTION", "422", "410")
FIELDS = markup(
    '<label>Age <input type="number" name="age"></label>'
    '<label><input type="checkbox" name="robots" value="yes">Robots</label>'
    '<label>Words <textarea name="words"></textarea></label>'
)


@pytest.fixture(scope="module")
def site() -> Iterator[SmallSite]:
    with serve_small() as site:
        yield site


@pytest.fixture
def page(site: SmallSite, open_context: OpenContext) -> Iterator[Page]:
    """A page with two items and three fields."""
    site.renew()
    site.show("{{ FORM }}", items=items("long", "clear"), fields=FIELDS)
    page = open_context(expected=LOST, **DESKTOP).new_page()
    page.goto("/")
    started(page)
    yield page
    site.gate.set()
    page.close()


def started(page: Page) -> None:
    page.locator("[data-clock=running]").wait_for()


def answer(page: Page) -> None:
    page.locator("#rating-long-4").check()
    page.locator("[name=age]").fill("33")
    page.locator("[name=robots]").check()
    page.locator("[name=words]").fill("Not yet.")


def press(page: Page) -> None:
    """Press at once, as people do: Playwright would wait until the button is no longer said to be busy."""
    page.locator(".page-form button").click(force=True)


def answers(sent: Sent) -> dict[str, str]:
    return {name: sent.fields.get(name, "") for name in ("nonce", "rating-long", "age", "robots", "words")}


GIVEN = {"nonce": "n1", "rating-long": "4", "age": "33", "robots": "yes", "words": "Not yet."}


def test_answers_are_sent_in_the_background_and_the_page_follows(page: Page, site: SmallSite) -> None:
    answer(page)
    press(page)
    page.wait_for_url("**/next")
    assert [(sent.by_script, answers(sent)) for sent in site.sent] == [(True, GIVEN)]
    assert int(site.sent[0].fields["time-long"]) > 0
    assert page.evaluate("Object.keys(sessionStorage)") == []


def test_a_second_press_while_it_is_on_its_way_does_nothing(page: Page, site: SmallSite) -> None:
    gate = threading.Event()

    def wait(sent: Sent) -> Reply:
        gate.wait(10)
        return go_on(sent)

    site.answer = wait
    button = page.locator(".page-form button")
    press(page)
    expect(button).to_have_text("Sending")
    expect(button).to_have_attribute("aria-disabled", "true")
    expect(button).to_be_focused()
    press(page)
    page.keyboard.press("Enter")
    gate.set()
    page.wait_for_url("**/next")
    assert len(site.sent) == 1


@pytest.mark.parametrize("status", [422, 410, 200])
def test_what_the_server_answers_with_a_page_is_sent_once_more_so_that_it_is_seen(
    page: Page, site: SmallSite, status: int
) -> None:
    site.answer = lambda _: Reply(status, "Something is missing")
    answer(page)
    press(page)
    expect(page.get_by_role("heading")).to_have_text("Something is missing")
    assert [(sent.by_script, answers(sent)) for sent in site.sent] == [(True, GIVEN), (False, GIVEN)]
    assert site.sent[1].named("painted") == [["painted", "", ""]]


def test_a_server_in_trouble_is_asked_again_with_the_same_answers(page: Page, site: SmallSite) -> None:
    site.answer = lambda sent: Reply(503, "Busy") if len(site.sent) < 2 else go_on(sent)
    answer(page)
    press(page)
    notice = page.locator(".page-form [role=status]")
    expect(notice).to_have_text("We try again.")
    expect(page.get_by_role("button", name="Send", exact=True)).to_be_enabled()
    page.wait_for_url("**/next")
    assert [answers(sent) for sent in site.sent] == [GIVEN, GIVEN]


def test_a_press_between_two_tries_tries_at_once(page: Page, site: SmallSite) -> None:
    site.answer = lambda sent: Reply(503, "Busy") if len(site.sent) < 3 else go_on(sent)
    press(page)
    expect(page.locator(".sending-notice")).to_have_text("We try again.")
    began = time.monotonic()
    for tries in (2, 3):
        press(page)
        page.wait_for_function("() => document.querySelector('.page-form button')?.textContent !== 'Sending'")
        assert len(site.sent) >= tries
    page.wait_for_url("**/next")
    assert time.monotonic() - began < 1


def test_a_key_that_is_held_down_does_not_besiege_a_server_in_trouble(page: Page, site: SmallSite) -> None:
    site.answer = lambda _: Reply(503, "Busy")
    page.locator(".page-form button").focus()
    for _ in range(20):
        page.keyboard.down("Enter")
        page.wait_for_timeout(10)
    page.keyboard.up("Enter")
    assert len(site.sent) <= 3  # The first, and what is tried again by itself on a slow machine.


def test_without_a_connection_the_answers_wait_for_it(page: Page, site: SmallSite) -> None:
    answer(page)
    page.context.set_offline(True)
    press(page)
    expect(page.locator(".sending-notice")).to_have_text("You are offline.")
    assert page.locator("[name=words]").input_value() == "Not yet."
    page.wait_for_timeout(1500)  # By now the waits are two seconds long; being online again ends them.
    began = time.monotonic()
    page.context.set_offline(False)
    page.wait_for_url("**/next")
    assert time.monotonic() - began < 1
    assert [answers(sent) for sent in site.sent] == [GIVEN]


def test_an_answer_that_got_lost_is_asked_for_again_with_the_same_nonce(page: Page, site: SmallSite) -> None:
    page.route("**/send", lambda route: (route.fetch(), route.abort()), times=1)
    answer(page)
    press(page)
    page.wait_for_url("**/next")
    assert [answers(sent) for sent in site.sent] == [GIVEN, GIVEN]


def test_a_page_loaded_anew_still_has_what_was_answered(page: Page, site: SmallSite) -> None:
    answer(page)
    page.goto("/other")
    page.goto("/")  # A page of its own in the history: the browser itself puts nothing back.
    started(page)
    assert page.locator("#rating-long-4").is_checked()
    press(page)
    page.wait_for_url("**/next")
    assert answers(site.sent[0]) == GIVEN
    page.goto("/")
    assert page.locator("input:checked").count() == 0


def test_what_the_server_filled_in_is_left_alone(page: Page, site: SmallSite) -> None:
    answer(page)
    site.show(
        "{{ FORM }}",
        fields=markup(
            '<input name="age" value="20" aria-label="Age"><textarea name="words" aria-label="Words"></textarea>'
        ),
    )
    page.goto("/")
    started(page)
    assert page.locator("[name=age]").input_value() == "20"
    assert page.locator("[name=words]").input_value() == ""


def test_a_page_from_the_back_cache_can_be_sent(page: Page, site: SmallSite) -> None:
    site.answer = lambda _: Reply(content={"next": "#"})  # The page stays.
    press(page)
    expect(page.locator(".page-form button")).to_have_text("Sending")
    page.evaluate("dispatchEvent(new PageTransitionEvent('pageshow', { persisted: true }))")
    expect(page.locator(".page-form button")).to_have_text("Send", timeout=1000)
    site.answer = go_on
    press(page)
    page.wait_for_url("**/next")
    assert len(site.sent) == 2


def test_without_scripts_everything_is_there_and_the_form_is_sent(site: SmallSite, open_context: OpenContext) -> None:
    site.renew()
    site.show("{{ FORM }}", items=items("long"), fields=FIELDS)
    page = open_context(java_script_enabled=False, **DESKTOP).new_page()
    page.goto("/")
    answer(page)
    press(page)
    page.wait_for_url("**/next")
    assert [(sent.by_script, answers(sent)) for sent in site.sent] == [(False, GIVEN)]
    page.close()
