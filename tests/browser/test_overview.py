"""The dashboard stays up to date by itself, says so when it cannot, and works on any screen."""

import random
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.axe import assert_accessible
from tests.browser.participant import Participant
from tests.browser.researcher import sign_in, unblind
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, PHONE, OpenContext

EVERY_MS = 5000
PAGES = ("", "people", "allocation", "quality", "results", "data", "records", "study", "preview", "accounts")
CHART = """() => Array.from(document.querySelectorAll("tr[data-mean]"), (row) => {
    const plot = row.querySelector("svg").getBoundingClientRect();
    const dot = row.querySelector("circle").getBoundingClientRect();
    return [Number(row.dataset.mean), 1 + 4 * (dot.x + dot.width / 2 - plot.x) / plot.width];
})"""


@pytest.fixture
def page(site: Site, open_context: OpenContext) -> Iterator[Page]:
    """An open overview whose clock the test may turn."""
    page = open_context(expected=("ERR_FAILED", "401"), **DESKTOP).new_page()
    page.clock.install()
    sign_in(page, site)
    yield page
    page.close()


def arrive(site: Site, open_context: OpenContext) -> Participant:
    participant = Participant(open_context(**DESKTOP).new_page(), site, random.Random(10))
    participant.agree()
    return participant


def count(page: Page, name: str) -> int:
    return int(page.locator(f"[data-count={name}]").inner_text())


def test_whoever_arrives_and_goes_on_is_shown_and_announced(page: Page, site: Site, open_context: OpenContext) -> None:
    expect(page.locator("[data-pulse]")).to_be_visible()
    page.evaluate("window.stays = true")
    before, head = count(page, "arrived"), page.locator("[data-value=head_number]").inner_text()
    participant = arrive(site, open_context)
    page.clock.run_for(EVERY_MS)
    expect(page.locator("[data-count=arrived]")).to_have_text(str(before + 1))
    expect(page.locator("[aria-live=polite]")).to_contain_text(f"{before + 1} agreed")
    expect(page.locator("[data-step='0'] [data-value=count]")).to_have_text(str(before + 1))
    expect(page.locator("[data-value=head_number]")).not_to_have_text(head)
    row = page.locator("#participants tr").first
    expect(row).to_contain_text("consented")
    participant.go_on("instructions.start")
    page.clock.run_for(EVERY_MS)
    expect(row).to_contain_text("in progress")
    expect(row).to_contain_text("1 of ")
    expect(row.get_by_role("progressbar")).to_have_js_property("value", 1)
    assert page.evaluate("window.stays")
    row.get_by_role("link").click()
    expect(page.locator(".timeline")).to_contain_text("agreed to take part")


def test_tables_and_charts_are_taken_anew_and_keep_focus_and_scroll(
    page: Page, site: Site, open_context: OpenContext
) -> None:
    participant = arrive(site, open_context)
    for path, part in (("results", "results"), ("quality", "focus"), ("allocation", "cells"), ("", "times")):
        page.goto(f"/researcher/{path}")
        page.clock.run_for(EVERY_MS)
        page.evaluate("part => { window.stays = true; document.getElementById(part).dataset.old = ''; }", part)
        if path == "allocation":
            page.locator("#cells .table-frame").first.focus()
        arrive(site, open_context)
        page.clock.run_for(2 * EVERY_MS)
        expect(page.locator(f"#{part}:not([data-old])")).to_be_visible()
        assert page.evaluate("window.stays")
        if path == "allocation":
            expect(page.locator("#cells .table-frame").first).to_be_focused()
            expect(page.locator("[data-pulse]")).to_be_visible()
    before = page.locator("#times").text_content() or ""
    participant.go_on("instructions.start")
    page.clock.run_for(2 * EVERY_MS)
    expect(page.locator("#times")).to_contain_text("Instructions")
    expect(page.locator("#times")).not_to_have_text(before)


def test_a_list_of_people_stays_up_to_date_too(page: Page, site: Site, open_context: OpenContext) -> None:
    page.goto("/researcher/people?state=consented")
    found = page.locator("[data-value=num_found]")
    before = int(found.inner_text())
    arrive(site, open_context)
    page.clock.run_for(EVERY_MS)
    expect(found).to_have_text(str(before + 1))
    expect(page.locator("[aria-live=polite]")).to_have_text(f"{before + 1} found")


def test_a_server_that_does_not_answer_is_noticed_and_so_is_its_return(page: Page) -> None:
    expect(page.locator("[data-pulse]")).to_be_visible()
    page.route("**/status.json", lambda route: route.abort())
    page.clock.run_for(EVERY_MS)
    expect(page.locator("[data-problem]")).to_contain_text("does not answer")
    expect(page.locator("[data-pulse]")).to_be_hidden()
    page.unroute("**/status.json")
    page.clock.run_for(EVERY_MS)
    expect(page.locator("[data-problem]")).to_be_hidden()
    expect(page.locator("[data-pulse]")).to_be_visible()


def test_whoever_was_signed_out_is_told(page: Page) -> None:
    expect(page.locator("[data-pulse]")).to_be_visible()
    page.context.clear_cookies()
    page.clock.run_for(EVERY_MS)
    expect(page.locator("[data-problem]")).to_contain_text("signed out")


def test_the_dots_stand_where_the_numbers_of_the_table_say(page: Page, site: Site, open_context: OpenContext) -> None:
    participant = arrive(site, open_context)
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    for item, rating in {"likeliness": 1, "loveliness": 4, "general": 5}.items():
        participant.answer(item, rating)
    participant.send()
    page.goto("/researcher/results")
    expect(page.get_by_role("main")).to_contain_text("Arm ")
    drawn = page.evaluate(CHART)
    assert sorted(mean for mean, _ in drawn) == [1, 4, 5]
    assert all(abs(mean - place) < 0.05 for mean, place in drawn)


def test_every_page_is_accessible_and_fits_the_screen(page: Page, site: Site, open_context: OpenContext) -> None:
    arrive(site, open_context)
    unblind(page, site)
    page.goto("/researcher/people")
    person = page.locator("#participants a").first.get_attribute("href")
    assert person is not None
    paths = [*(f"/researcher/{name}" for name in PAGES), person, f"{person}/erase"]
    for path in paths:
        page.goto(path)
        assert_accessible(page, path)
    phone = open_context(**PHONE).new_page()
    sign_in(phone, site)
    for path in paths:
        phone.goto(path)
        width = phone.evaluate("document.documentElement.scrollWidth")
        assert width <= PHONE["viewport"]["width"], path


def test_on_a_phone_the_trials_number_stays_beside_the_word(page: Page, site: Site, open_context: OpenContext) -> None:
    participant = arrive(site, open_context)
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    participant.rate("experiment1", 1)
    participant.send()
    unblind(page, site)
    page.goto("/researcher/people")
    person = page.locator("#participants a").first.get_attribute("href")
    phone = open_context(**PHONE).new_page()
    sign_in(phone, site)
    phone.goto(f"{person}")
    lines = "parts => parts.map((part) => part.getClientRects().length)"
    assert phone.locator("td .n").filter(has_text="trial").evaluate_all(lines) == [1, 1]


def test_a_preview_leads_through_all_pages_with_its_own_buttons(page: Page) -> None:
    page.goto("/researcher/preview/1")
    for number in range(1, 4):
        expect(page.locator(".test-banner")).to_contain_text(f"page {number} of ")
        page.locator("form.page-form button[type=submit]").click()
    expect(page.locator(".test-banner")).to_contain_text("page 4 of ")
    page.get_by_role("link", name="choose").click()
    expect(page.get_by_role("heading", name="Preview")).to_be_visible()
