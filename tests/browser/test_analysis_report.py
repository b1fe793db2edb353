"""The report of an analysis in a browser, without network: on a desktop, on a phone and on paper."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.axe import assert_accessible
from tests.browser.windows import DESKTOP, PHONE, watch
from tests.unit.reports.made_up import made_up_report, made_up_study
from webapp.reports.assembly import Assembled
from webapp.reports.figures import files_of
from webapp.reports.html import render

PAPER = {"A4": (210 - 32) * 96 / 25.4, "Letter": 8.5 * 96 - 32 * 96 / 25.4}
"""Widths between the margins of the print style, in CSS pixels."""

OVERFLOWING = """() => [...document.querySelectorAll("table, img, p, pre")]
    .filter((each) => each.getBoundingClientRect().right > document.documentElement.clientWidth + 1)
    .map((each) => each.outerHTML.slice(0, 200))"""

NOT_SHOWN = (
    """() => [...document.images].filter((each) => !each.complete || !each.naturalWidth).map((each) => each.alt)"""
)


@pytest.fixture(scope="module")
def made() -> Assembled:
    return made_up_report(made_up_study())


@pytest.fixture(scope="module")
def file(made: Assembled, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_bytes(render(made.report, {each.name: files_of(each)[".svg"] for each in made.report.figures}))
    return path


@pytest.fixture
def page(browser: Browser, file: Path) -> Iterator[Page]:
    """The report in a window that is offline and runs no scripts of the page."""
    complaints: list[str] = []
    context = browser.new_context(offline=True, **DESKTOP)
    watch(context, complaints, ())
    page = context.new_page()
    page.goto(file.as_uri())
    yield page
    context.close()
    assert complaints == []


def test_axe_finds_nothing(page: Page) -> None:
    assert_accessible(page, "report")


def test_every_figure_is_shown_without_network(page: Page, made: Assembled) -> None:
    assert page.locator("img").count() == len(made.report.figures)
    assert page.evaluate(NOT_SHOWN) == []


def test_on_a_phone_tables_scroll_and_the_page_does_not(page: Page) -> None:
    page.set_viewport_size(PHONE["viewport"])
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["viewport"]["width"]
    wide = page.get_by_role("region", name="A table that is wider than a phone")
    assert wide.evaluate("(region) => region.scrollWidth > region.clientWidth")
    wide.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function("(region) => region.scrollLeft > 0", arg=wide.element_handle())


def test_on_a_phone_the_whole_summary_is_in_sight_answers_first(page: Page) -> None:
    page.set_viewport_size(PHONE["viewport"])
    table = page.locator("#table-summary table")
    assert table.evaluate("(table) => table.getBoundingClientRect().right <= document.documentElement.clientWidth")
    row = table.locator("tbody tr").first
    tops = row.locator("th, td").evaluate_all("(cells) => cells.map((cell) => cell.getBoundingClientRect().top)")
    answer = row.locator("[data-column=answer]").evaluate("(cell) => cell.getBoundingClientRect().top")
    assert answer == min(tops)
    assert tops.count(answer) == 1


def test_the_contents_lead_to_each_section(page: Page, made: Assembled) -> None:
    links = page.get_by_role("navigation", name="Contents").get_by_role("link")
    assert links.all_inner_texts() == [section.title for section in made.report.sections]
    links.last.click()
    assert page.locator("section:target h2").inner_text().endswith("Methods and provenance")


@pytest.mark.parametrize("size", PAPER)
def test_on_paper_nothing_is_cut_at_the_side(page: Page, size: str) -> None:
    page.emulate_media(media="print")
    page.set_viewport_size({"width": int(PAPER[size]), "height": 1000})
    assert page.evaluate(OVERFLOWING) == []


def test_the_dark_report_prints_on_white(page: Page) -> None:
    page.emulate_media(media="print", color_scheme="dark")
    assert page.evaluate("getComputedStyle(document.documentElement).backgroundColor") == "rgb(255, 255, 255)"
