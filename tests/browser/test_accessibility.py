"""axe looks at every kind of page, on a large screen and on a phone, in light and in dark colours."""

import random
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from tests.browser.axe import assert_accessible
from tests.browser.participant import Participant
from tests.browser.researcher import sign_in
from tests.browser.site import Site
from tests.browser.windows import OpenContext


@pytest.fixture
def page(open_context: OpenContext) -> Iterator[Page]:
    page = open_context(expected=("422", "404", "403", "429")).new_page()
    yield page
    page.close()


def test_the_pages_around_the_study(page: Page, site: Site) -> None:
    page.goto("/")
    assert_accessible(page, "welcome")
    page.get_by_role("button", name=site.texts("welcome.start")).click()
    assert_accessible(page, "welcome without consent")
    page.goto("/declined")
    assert_accessible(page, "declined")
    participant = Participant(page, site, random.Random(5))
    participant.agree()
    page.goto("/leave")
    assert_accessible(page, "leave")
    participant.go_on("leave.confirm")
    assert_accessible(page, "left")


def test_the_pages_of_the_study(page: Page, site: Site) -> None:
    participant = Participant(page, site, random.Random(6))
    participant.agree()
    assert_accessible(page, "instructions")
    participant.go_on("instructions.start")
    for experiment, position in participant.trials():
        assert_accessible(page, f"situation {experiment}.{position}")
        participant.go_on("situation.continue")
        assert_accessible(page, f"rating {experiment}.{position}")
        participant.rate(experiment, position)
        participant.send()
    assert_accessible(page, "done")


def test_a_rating_page_with_missing_answers_and_one_with_a_notice(page: Page, site: Site) -> None:
    participant = Participant(page, site, random.Random(7))
    participant.agree()
    page.goto("/study/5")
    assert_accessible(page, "a page with a notice")
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    participant.button("explanation.send").click()
    page.locator(".error-summary").wait_for()
    assert_accessible(page, "a rating page with missing answers")


@pytest.mark.parametrize("address", ["/no-such-page", "/study/99", "/study"])
def test_the_pages_that_say_no(page: Page, address: str) -> None:
    page.goto(address)
    assert_accessible(page, address)


def test_the_pages_for_researchers(page: Page, site: Site) -> None:
    page.goto("/researcher/sign-in")
    assert_accessible(page, "sign in")
    page.get_by_label("Name").fill("somebody")
    page.get_by_label("Password").fill("something")
    page.get_by_role("button", name="Sign in").click()
    assert_accessible(page, "sign in refused")
    sign_in(page, site)
    assert_accessible(page, "overview")
