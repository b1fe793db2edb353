"""The researcher's overview stays up to date by itself, and says so when it cannot."""

import random
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.participant import Participant
from tests.browser.researcher import sign_in
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, OpenContext

EVERY_MS = 5000
CHARTS = """() => Array.from(document.querySelectorAll("canvas"), (canvas) => {
    const { labels, datasets } = window.Chart.getChart(canvas).data;
    return datasets.flatMap(({ label, data }) => data.map((mean, i) => [labels[i], label, mean]));
}).flat()"""


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
    before = count(page, "arrived")
    participant = arrive(site, open_context)
    page.clock.run_for(EVERY_MS)
    expect(page.locator("[data-count=arrived]")).to_have_text(str(before + 1))
    expect(page.locator("[aria-live=polite]")).to_contain_text(f"{before + 1} agreed")
    row = page.locator("#participants tr").first
    expect(row).to_contain_text("consented")
    participant.go_on("instructions.start")
    page.clock.run_for(EVERY_MS)
    expect(row).to_contain_text("in progress")
    expect(row).to_contain_text("1 of ")
    expect(row.get_by_role("progressbar")).to_have_js_property("value", 1)
    assert page.evaluate("window.stays")


def test_a_server_that_does_not_answer_is_noticed_and_so_is_its_return(page: Page) -> None:
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


def test_the_bars_show_the_numbers_of_the_table(page: Page, site: Site, open_context: OpenContext) -> None:
    participant = arrive(site, open_context)
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    for item, rating in {"likeliness": 1, "loveliness": 4, "general": 5}.items():
        participant.answer(item, rating)
    participant.send()
    expect(page.locator("canvas")).to_have_count(0)
    page.get_by_role("button", name="Reveal the ratings").click()
    expect(page.get_by_role("img", name="Experiment 1")).to_be_visible()
    rows = [row.locator("td").all_inner_texts() for row in page.locator("[data-chart] tbody tr").all()]
    drawn = [(item, kind, f"{mean:.2f}") for item, kind, mean in page.evaluate(CHARTS)]
    assert len(rows) == 3
    assert sorted(drawn) == sorted((item, kind, mean) for item, kind, mean, *_ in rows)
