"""The button that sends a page: deaf to an impatient second press, never to a later try."""

import random
from collections.abc import Iterator
from http import HTTPStatus

import pytest
from playwright.sync_api import Page, Request, Route, expect

from tests.browser.participant import Participant
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, OpenContext


@pytest.fixture
def participant(site: Site, open_context: OpenContext) -> Iterator[Participant]:
    """Somebody on the page with the three facts."""
    page = open_context(**DESKTOP).new_page()
    participant = Participant(page, site, random.Random(9))
    participant.agree()
    yield participant
    page.close()


def lose(page: Page) -> list[Request]:
    """Let the page's next forms get lost on their way, so that the page stays; return what was sent."""
    sent: list[Request] = []

    def take(route: Route) -> None:
        sent.append(route.request)
        route.fulfill(status=HTTPStatus.NO_CONTENT)

    page.route("**/study/1", take)
    return sent


def press(participant: Participant) -> None:
    """Press at once, as people do: Playwright would wait until the button is no longer said to be busy."""
    participant.page.locator(".page-form button").click(force=True)


def test_a_press_while_a_page_is_on_its_way_sends_nothing_more(participant: Participant, site: Site) -> None:
    sent = lose(participant.page)
    press(participant)
    expect(participant.page.locator(".page-form button")).to_have_text(site.texts("page.sending"))
    expect(participant.page.locator(".page-form button")).to_be_focused()
    press(participant)
    participant.page.keyboard.press("Enter")
    participant.page.wait_for_timeout(300)
    assert len(sent) == 1


def test_after_a_page_was_lost_on_its_way_the_next_press_sends_it(participant: Participant) -> None:
    sent = lose(participant.page)
    press(participant)
    expect(participant.button("instructions.start")).to_be_visible(timeout=8000)
    assert len(sent) == 1
    participant.page.unroute("**/study/1")
    participant.go_on("instructions.start")
    assert participant.page.url.endswith("/study/2")
