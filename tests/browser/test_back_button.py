"""The browser's Back button after a form came back with something missing."""

import random
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.participant import Participant
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, OpenContext

RESUBMISSION = "ERR_CACHE_MISS"
"""What Chromium calls the page that asks whether a form is to be sent again."""


@pytest.fixture
def participant(site: Site, open_context: OpenContext) -> Iterator[Participant]:
    """Somebody who forgets something on each form, and is told so."""
    page = open_context(expected=("422",), **DESKTOP).new_page()
    yield Participant(page, site, random.Random(1))
    page.close()


def told_of_one_missing_answer(participant: Participant) -> str:
    """Send the first rating page but for its last item, which is returned."""
    participant.agree()
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    *given, missing = participant.items()
    for item in given:
        participant.answer(item, 4)
    participant.button("explanation.send").click()
    expect(participant.page.locator(".error-summary")).to_be_visible()
    return missing


def go_back(page: Page) -> None:
    page.go_back()
    assert RESUBMISSION not in page.content()
    assert page.url.startswith("http")


def test_back_from_the_page_after_a_mended_one_says_that_it_is_answered(participant: Participant, site: Site) -> None:
    missing = told_of_one_missing_answer(participant)
    participant.answer(missing, 2)
    participant.send()
    participant.page.wait_for_url("**/study/4")
    stored = site.export("ratings.csv")
    go_back(participant.page)
    expect(participant.page.get_by_text(site.texts("notices.already_answered"))).to_be_visible()
    assert participant.page.url.endswith("/study/4")
    participant.page.reload()
    assert participant.page.url.endswith("/study/4")
    assert site.export("ratings.csv") == stored


def test_back_and_back_again_after_following_the_summary_asks_for_no_resubmission(
    participant: Participant, site: Site
) -> None:
    missing = told_of_one_missing_answer(participant)
    participant.page.locator(".error-summary a").click()
    expect(participant.page.locator(f"#rating-{missing}-1")).to_be_focused()
    participant.answer(missing, 2)
    participant.send()
    participant.page.wait_for_url("**/study/4")
    stored = site.export("ratings.csv")
    for _ in range(2):
        go_back(participant.page)
        expect(participant.page.get_by_text(site.texts("notices.already_answered"))).to_be_visible()
        assert participant.page.url.endswith("/study/4")
    assert site.export("ratings.csv") == stored


def test_a_reload_of_a_page_that_lacked_an_answer_keeps_the_others(participant: Participant) -> None:
    missing = told_of_one_missing_answer(participant)
    participant.page.reload()
    expect(participant.page.locator(".error-summary")).to_be_visible()
    given = [item for item in participant.items() if item != missing]
    assert all(participant.page.locator(f"#rating-{item}-4").is_checked() for item in given)


def test_back_from_leaving_shows_the_page_that_lacked_an_answer(participant: Participant, site: Site) -> None:
    missing = told_of_one_missing_answer(participant)
    participant.page.get_by_role("link", name=site.texts("page.leave")).click()
    participant.page.wait_for_url("**/leave")
    go_back(participant.page)
    assert participant.page.url.endswith("/study/3")
    assert missing in participant.items()


def test_back_to_a_consent_that_was_first_forgotten_leads_on(participant: Participant, site: Site) -> None:
    page = participant.page
    before = len(site.export("participants.csv"))
    page.goto("/")
    page.get_by_role("button", name=site.texts("welcome.start")).click()
    page.locator(".error-summary a").click()
    expect(page.get_by_role("checkbox")).to_be_focused()
    page.get_by_role("checkbox").check()
    page.get_by_role("button", name=site.texts("welcome.start")).click()
    page.wait_for_url("**/study/1")
    go_back(page)
    assert page.url.endswith("/study/1")
    assert len(site.export("participants.csv")) == before + 1
