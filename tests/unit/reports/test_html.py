"""The report as a page: whole, safe, loading nothing, and with the same things in it as in the blocks."""

import re
from html.parser import HTMLParser

import pytest

from tests.unit.reports.made_up import made_up_report, made_up_study
from webapp.reports.blocks import Block, Column, Figure, Section, Statement, Table
from webapp.reports.figures import files_of
from webapp.reports.html import render
from webapp.reports.report import Report

VOID = {"meta", "img", "link", "wbr", "br"}


class Page(HTMLParser):
    """Reads a page and complains about what is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.headings: list[str] = []
        self.words = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.words += data
        if self.open and self.open[-1] in {"h1", "h2"}:
            self.headings.append(data.strip())

    def attributes(self, name: str) -> list[str]:
        return [value or "" for _, found in self.tags for key, value in found.items() if key == name]

    def count(self, tag: str) -> int:
        return sum(found == tag for found, _ in self.tags)


@pytest.fixture(scope="module")
def report() -> Report:
    return made_up_report().report


@pytest.fixture(scope="module")
def text(report: Report) -> str:
    return render(report, {figure.name: files_of(figure)[".svg"] for figure in report.figures}).decode()


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


def page_of(*blocks: Block) -> Page:
    return Page(render(Report("Title", (), (Section("only", "Only", blocks),)), {}).decode())


def test_the_page_loads_nothing_and_runs_nothing(text: str, page: Page) -> None:
    assert not re.search(r"https?://", text)
    assert not re.search(r"url\(|@import", text)
    assert not {"script", "link", "iframe", "object", "base", "form"} & {tag for tag, _ in page.tags}
    assert all(address.startswith("data:image/svg+xml;base64,") for address in page.attributes("src"))
    assert not [name for _, found in page.tags for name in found if name.startswith("on")]


def test_every_section_table_and_figure_is_there_once_and_in_order(report: Report, page: Page) -> None:
    assert page.count("h1") == 1
    assert [title for title in page.headings if title in {section.title for section in report.sections}] == [
        section.title for section in report.sections
    ]
    tables, figures = page.words.count("Table "), page.words.count("Figure ")
    assert (tables, figures) == (len(report.tables), len(report.figures))
    num_assumed = sum(bool(section.assumptions) for section in report.sections)
    assert page.count("table") == page.count("caption") == len(report.tables) + num_assumed
    assert page.count("img") == page.count("figcaption") == len(report.figures)


def test_ids_are_unique_and_links_lead_to_them(page: Page) -> None:
    ids = page.attributes("id")
    assert len(ids) == len(set(ids))
    assert {link.removeprefix("#") for link in page.attributes("href")} <= set(ids)
    assert set(" ".join(page.attributes("aria-labelledby")).split()) <= set(ids)


def test_every_heading_cell_says_whether_it_heads_a_row_or_a_column(page: Page) -> None:
    scopes = [found.get("scope") for tag, found in page.tags if tag == "th"]
    assert set(scopes) == {"col", "row"}
    assert all(alt for alt in page.attributes("alt"))


def test_texts_are_texts_whatever_is_in_them() -> None:
    evil = '<script>alert("1")</script> & </table>'
    page = page_of(evil, Statement(evil, evil), Table("t", evil, (Column("a", evil),), ((evil,),), evil))
    assert page.count("script") == 0
    assert page.words.count(evil) >= 6


def test_lines_with_bullets_become_a_list_and_other_lines_stay_lines() -> None:
    page = page_of("Two things:\n• one\n• two", "# Plan\n\n1. compare\n2. stop", "a paragraph")
    assert (page.count("ul"), page.count("li")) == (1, 2 + 1)  # The contents are a list too.
    assert "# Plan\n\n1. compare\n2. stop" in page.words
    assert page.attributes("class").count("paragraph") == 2


def test_the_verdict_on_an_assumption_is_a_word(page: Page) -> None:
    for verdict in ("holds", "doubtful", "violated", "not checkable", "by design"):
        assert verdict in page.words


def test_a_statement_is_told_apart_from_a_paragraph_by_words() -> None:
    page = page_of(Statement("the mean", "there is 1 person"))
    assert "No number: the mean" in page.words
    assert "there is 1 person" in page.words


def test_a_name_is_given_once_in_a_report() -> None:
    table = Table("same", "Same", (Column("a", "A"),), ())
    with pytest.raises(ValueError, match="each table once, and same"):
        Report("Title", (), (Section("one", "One", (table,)), Section("two", "Two", (table,))))
    with pytest.raises(ValueError, match="each section once, and one"):
        Report("Title", (), (Section("one", "One", ()), Section("one", "One", ())))


def test_a_drawn_figure_has_both_files_and_the_same_bytes_each_time(report: Report) -> None:
    figure = next(figure for figure in report.figures if isinstance(figure, Figure))
    assert set(files_of(figure)) == {".svg", ".png"}
    assert files_of(figure) == files_of(figure)


@pytest.mark.parametrize(
    ("mode", "said"), [("bot", "programs, not of people"), ("test", "of a test run"), ("live", "")]
)
def test_answers_of_no_participants_are_called_so_above_the_first_section(mode: str, said: str) -> None:
    made = made_up_report(made_up_study(mode=mode), {}).report
    text = render(made, {figure.name: files_of(figure)[".svg"] for figure in made.figures}).decode()
    assert bool(made.banner) == bool(said)
    assert said in made.banner
    assert ('class="banner"' in text) == bool(said)
    assert not said or text.index(made.banner) < text.index("Contents</h2>")


def test_columns_of_short_texts_do_not_break_them() -> None:
    columns = (Column("kind", "Kind"), Column("reason", "Reason"))
    page = page_of(Table("t", "T", columns, (("evenly_spaced", "a reason that is longer"),)))
    assert page.attributes("class").count("text brief") == 2
