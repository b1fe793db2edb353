"""The clock of a rating page: from the paint of the explanation to the last change of each item."""

import random
import time
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, Route

from tests.browser.participant import Participant
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, OpenContext

ITEMS = ("likeliness", "loveliness", "general")
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"

Arrive = Callable[[], Participant]


@pytest.fixture
def arrive(site: Site, open_context: OpenContext) -> Iterator[Arrive]:
    """Bring a participant to the page before the first explanation."""
    pages: list[Page] = []

    def arrive() -> Participant:
        pages.append(open_context(expected=("422",), **DESKTOP).new_page())
        participant = Participant(pages[-1], site, random.Random(8))
        participant.agree()
        participant.go_on("instructions.start")
        return participant

    yield arrive
    for page in pages:
        page.close()


def open_explanation(participant: Participant) -> None:
    participant.go_on("situation.continue")
    participant.page.evaluate(TWO_FRAMES)


def time_of(participant: Participant, item: str) -> str:
    return participant.page.locator(f"[name='time-{item}']").input_value()


def times(participant: Participant) -> dict[str, str]:
    return {item: time_of(participant, item) for item in ITEMS}


def test_the_clock_waits_until_all_pictures_are_there(arrive: Arrive) -> None:
    participant = arrive()
    page = participant.page
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/pictures/*.png", hold)
    participant.button("situation.continue").click(no_wait_after=True)
    page.wait_for_url("**/study/3", wait_until="domcontentloaded")
    page.wait_for_timeout(1500)
    participant.answer("general", 2)
    assert times(participant) == dict.fromkeys(ITEMS, "")

    assert held
    released_at = time.monotonic()
    for route in held:
        route.continue_()
    page.unroute("**/pictures/*.png")
    page.wait_for_load_state("load")
    page.locator("form[data-clock=running]").wait_for()
    participant.answer("likeliness", 4)
    assert 0 < int(time_of(participant, "likeliness")) <= (time.monotonic() - released_at) * 1000


def test_the_last_change_of_each_item_counts(arrive: Arrive) -> None:
    participant = arrive()
    open_explanation(participant)
    participant.answer("likeliness", 2)
    first = int(time_of(participant, "likeliness"))
    participant.page.wait_for_timeout(400)
    participant.answer("likeliness", 5)
    assert int(time_of(participant, "likeliness")) >= first + 400
    assert time_of(participant, "loveliness") == time_of(participant, "general") == ""


def test_a_page_that_comes_back_with_errors_keeps_its_times_and_its_clock(arrive: Arrive) -> None:
    participant = arrive()
    open_explanation(participant)
    participant.page.wait_for_timeout(700)
    participant.answer("likeliness", 3)
    kept = time_of(participant, "likeliness")
    participant.button("explanation.send").click()
    participant.page.locator("[data-error-summary]").wait_for()
    participant.page.wait_for_load_state()  # By then the scripts have run.
    assert times(participant) == {"likeliness": kept, "loveliness": "", "general": ""}
    participant.answer("general", 1)
    assert int(time_of(participant, "general")) > int(kept) >= 700


def test_loading_the_page_anew_does_not_set_the_clock_back(arrive: Arrive) -> None:
    participant = arrive()
    open_explanation(participant)
    participant.answer("likeliness", 3)
    participant.page.wait_for_timeout(700)
    participant.page.reload()
    for item in ITEMS:
        assert bool(time_of(participant, item)) == participant.page.locator(f"[name='rating-{item}']:checked").count()
    participant.answer("general", 1)
    assert int(time_of(participant, "general")) > 700


def test_every_page_has_a_clock_of_its_own(arrive: Arrive) -> None:
    participant = arrive()
    open_explanation(participant)
    participant.page.wait_for_timeout(2000)
    participant.answer_all(3)
    participant.send()
    began = time.monotonic()
    open_explanation(participant)
    participant.answer("general", 1)
    assert int(time_of(participant, "general")) <= (time.monotonic() - began) * 1000
