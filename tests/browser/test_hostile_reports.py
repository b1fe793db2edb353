"""The report of an analysis of a data set whose every text is hostile, in a real browser and without any policy.

Whoever gets a data set from somebody else analyses what they did not write. A report is a file: no header of ours
protects it, so that whatever came to life in it would run.
"""

import base64
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from markupsafe import Markup
from playwright.sync_api import Browser, Page

from tests.browser.hostile_windows import listen, missing, read, texts_of
from tests.browser.windows import DESKTOP, watch
from tests.security.payload_families import MARKER
from tests.security.payloads import PAYLOADS, as_read
from tests.unit.reports.data_sets import Tables, decision, tables, write_plain
from tests.unit.reports.made_up import made_up_report, planned
from webapp.reports.analysis import prepare
from webapp.reports.assembly import Assembled, Maker
from webapp.reports.blocks import Assumption, Column, Drawing, Section, Statement, Table
from webapp.reports.figures import files_of
from webapp.reports.html import render

TEXTS = tuple(dict.fromkeys(text for text in (as_read(text).replace("\0", "").strip() for text in PAYLOADS) if text))
"""The payloads as a file of a data set can hold them: with a NUL it is refused as damaged."""

_SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><text>x</text></svg>'


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A window without network in which nothing runs or opens."""
    complaints: list[str] = []
    context = browser.new_context(offline=True, **DESKTOP)
    watch(context, complaints, ())
    dialogs = listen(context)
    yield context.new_page()
    context.close()
    assert (complaints, dialogs) == ([], [])


def shown_by(page: Page, made: Assembled, folder: Path) -> str:
    """Open a report as a file and return its HTML."""
    content = render(made.report, {each.name: files_of(each)[".svg"] for each in made.report.figures})
    path = folder / "report.html"
    path.write_bytes(content)
    page.goto(path.as_uri())
    return content.decode()


def made_of(text: str, texts: Sequence[str] = ()) -> Mapping[str, Maker]:
    """Return the maker of a section that has a text in every place that takes one, and others in a table."""
    columns = (Column("name", text), Column("word", text))
    blocks = (
        text,
        f"\N{BULLET} {text}\n\N{BULLET} {text}",
        Statement(text, text),
        Drawing("drawing", text, text, _SVG),
        Table("table", text, columns, tuple((each, each) for each in (text, *texts)), text),
    )
    assumed = (Assumption(text, text, text, "holds"),)
    # Every report has its planned comparisons, which the summary is made of.
    return {"ordinal": planned, "hostile": lambda _: Section("hostile", text, blocks, assumed)}


def test_a_report_shows_hostile_texts_as_texts_wherever_a_text_can_stand(page: Page, tmp_path: Path) -> None:
    for text in TEXTS[::20]:
        shown_by(page, made_up_report(makers=made_of(text, TEXTS)), tmp_path)
        assert missing([*TEXTS, *text.splitlines()], texts_of(page)) == []
    titled = made_up_report(makers=made_of(TEXTS[0]))
    facts = (("Mode", TEXTS[2]), (TEXTS[3], TEXTS[4]))
    shown_by(page, replace(titled, report=replace(titled.report, title=TEXTS[1], facts=facts)), tmp_path)
    assert missing(TEXTS[:5], texts_of(page)) == []


def test_a_hostile_data_set_makes_a_report_of_texts(page: Page, tmp_path: Path) -> None:
    analysis = prepare(write_plain(tmp_path / "data", hostile_tables()))
    html = shown_by(page, analysis.report(), tmp_path)
    told = texts_of(page)
    people = [text for text in TEXTS if _is_a_name(text)]
    assert len(people) >= 200
    assert missing(people, told) == []
    reasons = [" ".join(text.split()) for text in TEXTS]
    assert missing(reasons, told) == []
    drawn = [base64.b64decode(one) for one in re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", html)]
    assert len(drawn) >= 5
    assert any(MARKER.encode() in one for one in drawn), "no hostile text stands in any figure"
    for one in drawn:
        figure = ET.fromstring(one)  # noqa: S314 - ours, and what is wrong with it is to be found here
        assert not [element.tag for element in figure.iter() if MARKER in element.attrib or "script" in element.tag]


def test_a_report_that_escapes_nothing_is_caught(browser: Browser, tmp_path: Path) -> None:
    """The control: a text that says of itself that it is HTML comes to life, and opens a dialog."""
    context = browser.new_context(offline=True, **DESKTOP)
    dialogs = listen(context)
    page = context.new_page()
    shown_by(page, made_up_report(makers=made_of(Markup(f"<script {MARKER}>alert(1)</script>"))), tmp_path)  # noqa: S704 - the control
    found = read(page)
    context.close()
    assert found["marked"] >= 1
    assert dialogs
    assert set(dialogs) == {"1"}


def hostile_tables() -> Tables:
    """Return a data set in which study, people, layouts, kinds, items and reasons are hostile."""
    people = [text for text in TEXTS if _is_a_name(text)]
    data = tables(people)
    names: dict[str, str] = {"random": "random"}
    for rows in data.values():
        for row in rows:
            row["study"] = TEXTS[20]
            for part in ("kind", "item"):
                if part in row:
                    row[part] = _renamed(row[part], names)
    # Without a study file a correction is of the one answer that fits it.
    times = Counter(_answer(row) for row in data["ratings"])
    by_person = {row["participant"]: row for row in data["ratings"] if times[_answer(row)] == 1}
    data["decisions"] = [
        decision(person, "corrected", number, **_corrected(by_person[person]), reason=TEXTS[number % len(TEXTS)])
        | {"study": TEXTS[20], "by": TEXTS[-1 - number % len(TEXTS)]}
        for number, person in enumerate([*by_person] * 2, 1)
    ]
    return data


def _answer(row: Mapping[str, str]) -> tuple[str, str, str]:
    return row["participant"], row["item"], row["rating"]


def _corrected(row: Mapping[str, str]) -> dict[str, Any]:
    return {"page": "3", "file": "ratings", "question": row["item"], "from": row["rating"], "to": "3"}


def _renamed(name: str, names: dict[str, str]) -> str:
    """Return another name for a kind or an item, short enough to stand in figures."""
    possible = [text for text in TEXTS if MARKER in text and len(text) < 50 and _is_a_name(text)]
    return names.setdefault(name, possible[7 * len(names)])


def _is_a_name(text: str) -> bool:
    return text == " ".join(text.split())
