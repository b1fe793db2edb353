"""Hostile texts in every field that a person or a study file can fill, on the pages that show them.

No text may become an element or an attribute, run, open a dialog or meet the page's policy, and each one is shown as it
was written. What links, headers and files hold is looked at by `test_hostile_requests`, and the report of an analysis
by `test_hostile_reports`.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from jinja2 import Environment, FileSystemLoader
from playwright.sync_api import Page, Route

from tests.browser.hostile_site import IDS, NOW, REASONS, TOKEN, TYPED, HostileSite, pages_for, send, serve_hostile
from tests.browser.hostile_windows import FETCH, listen, missing, read, texts_of
from tests.browser.researcher import sign_in, unblind
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, OpenContext
from tests.conftest import ROOT
from tests.security.payload_families import MARKER
from tests.security.payloads import PAYLOADS, shown
from webapp.storage.database import open_database
from webapp.storage.people import exclude, exclusion_states, include
from webapp.views.researcher.data_pages import MAX_LISTED
from webapp.views.security import CONTENT_SECURITY_POLICY


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HostileSite]:
    with serve_hostile(tmp_path_factory.mktemp("hostile")) as hostile:
        yield hostile


@pytest.fixture(scope="module")
def site(hostile: HostileSite) -> Site:
    return hostile.site


def test_there_are_enough_payloads_and_each_field_gets_its_share() -> None:
    assert len(PAYLOADS) >= 200
    assert min(len(TYPED), len(REASONS), len(IDS)) >= 200


def test_texts_of_a_study_and_answers_are_shown_as_texts(page: Page, hostile: HostileSite) -> None:
    expected = {shown(text) for entry in hostile.texts.entries.values() for text in _parts(entry)}
    seen = []
    for path in ("/", "/?lang=xx", "/declined", "/?PROLIFIC_PID=x", "/study/1", "/ask", "/ask?layout=experiment1-a"):
        page.goto(path)
        seen.append(texts_of(page))
    page.context.add_cookies([{"name": "participant", "value": TOKEN, "url": hostile.site.address}])
    for path in ("/leave", "/another-device", f"/resume/{TOKEN}", "/study/99", "/nowhere"):
        page.goto(path)
        seen.append(texts_of(page))
    with open_database(hostile.site.instance / "xar.sqlite3", make=False) as database:
        planned = pages_for(database, hostile.person, hostile.study)
        for planned_page in planned:
            page.goto(f"/study/{planned_page.number}")
            assert page.url.endswith(f"/study/{planned_page.number}")
            seen.append(texts_of(page))
            if planned_page.kind == "background":
                seen.append(_sent_with_a_gap(page))
                assert missing(TYPED, seen[-1]) == []
            send(database, hostile.person, hostile.study, planned_page)
        page.goto("/done")
        seen.append(texts_of(page))
    everything = " ".join(seen)
    assert hostile.study.contact in everything
    found = [text for text in expected if text in everything]
    assert len(found) >= 200, len(found)


def test_what_people_wrote_is_shown_to_researchers_as_texts(page: Page, hostile: HostileSite, tmp_path: Path) -> None:
    sign_in(page, hostile.site)
    for path in ("", "allocation", "quality", "results", "study", "preview", "records?show=decisions"):
        page.goto(f"/researcher/{path}")
        texts_of(page)
    page.goto("/researcher/accounts")
    assert missing(hostile.names, texts_of(page)) == []
    person = f"/researcher/people/{hostile.decided.code}"
    page.goto(person)
    told = texts_of(page)
    assert missing([*REASONS, *TYPED], told) == []
    assert missing(PAYLOADS[-len(REASONS) + 1 :], told) == [], "the names of those who decided"
    page.goto(f"{person}/erase")
    texts_of(page)
    for path in ("/researcher/people", "/researcher/people?page=2", "/researcher/people?excluded=yes"):
        page.goto(path)
        texts_of(page)
    page.goto("/researcher/preview/1")
    texts_of(page)
    listed = IDS[: MAX_LISTED - 5]
    assert missing(listed, _compared(page, tmp_path, listed)) == []
    unlisted = missing(IDS, _compared(page, tmp_path, ["nobody"]))
    assert len(unlisted) <= len(IDS) + 2 - MAX_LISTED


def test_pictures_of_the_flow_stay_pictures(page: Page, hostile: HostileSite) -> None:
    hidden = "\x01\x0b\x1b\ufffe <img src=x data-xss onerror=hit(1)>"
    with open_database(hostile.site.instance / "xar.sqlite3", make=False) as database:
        with database.read() as connection:
            is_excluded = hostile.decided.id in exclusion_states(connection)
        if is_excluded:
            include(database, hostile.decided.code, "again", "ada", NOW)
        exclude(database, hostile.decided.code, hidden, "ada", NOW)
    sign_in(page, hostile.site)
    unblind(page, hostile.site, PAYLOADS[0])
    page.goto("/researcher/data")
    texts_of(page)
    assert page.locator("img.flow").evaluate("async image => { await image.decode(); return image.naturalWidth; }") > 0
    ((status, figure),) = page.evaluate(FETCH, ["/researcher/consort.svg"])
    drawn = ET.fromstring(figure)  # noqa: S314 - ours, and what is wrong with it is to be found here
    assert status == 200
    assert all(MARKER not in element.attrib for element in drawn.iter())
    assert "<img src=x data-xss" in "".join(drawn.itertext())
    # As a page of its own the figure is under our policy, which stops styles within it: whatever is stopped complains.
    page.goto("/researcher/consort.svg")
    looks = page.locator("rect").evaluate_all("all => all.map((one) => getComputedStyle(one).fill)")
    assert set(looks) == {"rgb(255, 255, 255)"}
    page.goto("/researcher/results")
    texts_of(page)


def test_a_page_that_escapes_nothing_is_caught(open_context: OpenContext) -> None:
    unsafe = Environment(loader=FileSystemLoader(ROOT / "templates"), autoescape=False)  # noqa: S701 - the control
    unsafe.globals.update(t=lambda key, **_: key)
    template = unsafe.from_string(
        '{% from "macros/dashboard.html" import reason_field %}{{ reason_field("x", typed, 9) }}'
    )
    heard: list[str] = []
    for policy in (CONTENT_SECURITY_POLICY, "default-src * 'unsafe-inline' data:"):
        page = open_context(expected=("",), **DESKTOP).new_page()
        dialogs = listen(page.context)
        page.on("console", lambda message: heard.append(message.text))
        for payload in (
            "</textarea><img src=x data-xss onerror=hit(1)>",
            "</textarea><script data-xss>alert(1)</script>",
        ):
            page.route("**/control", _answer(template.render(typed=payload), policy))
            page.goto("/control")
            page.wait_for_load_state("networkidle")
            found = read(page)
            assert found["marked"] == 1
            page.unroute("**/control")
        if policy == CONTENT_SECURITY_POLICY:
            assert (found["hits"], dialogs) == (0, [])
            assert any(words.startswith("CSP: ") for words in heard)
        else:
            assert dialogs == ["1"]


def _answer(html: str, policy: str) -> Any:  # noqa: ANN401 - as Playwright has it
    def fulfil(route: Route) -> None:
        headers = {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": policy}
        route.fulfill(body=f"<!doctype html><title>x</title>{html}", headers=headers)

    return fulfil


def _parts(entry: str | tuple[str, ...]) -> tuple[str, ...]:
    return (entry,) if isinstance(entry, str) else entry


def _sent_with_a_gap(page: Page) -> str:
    """Type every payload, leave one question out and send: what was typed comes back."""
    fill_in = (
        """texts => document.querySelectorAll("textarea").forEach((area, place) => { area.value = texts[place]; })"""
    )
    page.evaluate("() => document.querySelector('form.page-form').removeAttribute('data-send')")
    page.evaluate(fill_in, list(TYPED))
    last = page.locator("textarea").last
    kept = last.input_value()
    last.fill("")
    page.evaluate("() => HTMLFormElement.prototype.submit.call(document.querySelector('form.page-form'))")
    page.locator(".error-summary").wait_for()
    return f"{texts_of(page)} {shown(kept)}"


def _compared(page: Page, folder: Path, ids: Sequence[str]) -> str:
    """Compare a recruiter's list of these ids with those that are known here."""
    quoted = [text.replace(chr(34), chr(34) * 2) for text in ids]
    lines = ["Participant id,Status,Completion code", *(f'"{text}",APPROVED,"{text}"' for text in quoted)]
    path = folder / "list.csv"
    path.write_bytes("\r\n".join(lines).encode())
    page.goto("/researcher/data")
    page.get_by_label("The list, a CSV file").set_input_files(path)
    page.get_by_role("button", name="Compare").click()
    page.locator(".verdict, .field-error").first.wait_for()
    return texts_of(page)
