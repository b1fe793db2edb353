"""Hostile texts in every field that a person, a link or a study file can fill, on the pages that show them.

No text may become an element or an attribute, run, open a dialog or meet the page's policy, and each one is shown as it
was written. Pages are visited; of addresses, of which there are thousands, some are visited and the answers to all are
parsed by the same browser, Chromium.
"""

import http.client
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from jinja2 import Environment, FileSystemLoader
from playwright.sync_api import BrowserContext, Dialog, Page, Route

from tests.browser.hostile_site import IDS, NOW, REASONS, TOKEN, TYPED, HostileSite, pages_for, send, serve_hostile
from tests.browser.researcher import sign_in
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, OpenContext
from tests.conftest import ROOT
from tests.security.payloads import MARKER, PAYLOADS, as_quoted, as_read, as_sent, fitting, in_address, shown
from tests.web.people import Visitor
from tests.web.researchers import sign_in as sign_in_as
from webapp.app import create_app
from webapp.config import Config
from webapp.storage.database import open_database
from webapp.storage.people import exclude, exclusion_states, include
from webapp.views.researcher.data_pages import MAX_LISTED
from webapp.views.security import CONTENT_SECURITY_POLICY
from webapp.views.services import services_of

REFUSED = (
    "403 http://127",
    "400 http://127",
    "404 http://127",
    "422 http://127",
    "409 http://127",
    "Failed to load resource",
)
"""What hostile addresses are answered with."""

COUNT_HITS = "window.hits = 0; window.hit = () => { window.hits += 1; };"

READ = """documents => {
    const texts = [];
    let marked = 0;
    const read = (root) => {
        for (const element of root.querySelectorAll("*")) {
            marked += element.hasAttribute("data-xss");
            texts.push(...Array.from(element.attributes, (attribute) => attribute.value));
            for (const node of element.childNodes) if (node.nodeType === 3) texts.push(node.data);
            if (typeof element.value === "string") texts.push(element.value);
            if (element.localName === "template") read(element.content);
        }
    };
    if (documents === null) read(document);
    for (const html of documents ?? []) read(new DOMParser().parseFromString(html, "text/html"));
    return {marked, hits: window.hits ?? 0, text: texts.join("\\n\\n")};
}"""

FETCH = """async (paths) => {
    const answers = [];
    const next = async () => {
        while (paths.length) {
            const response = await fetch(paths.pop());
            answers.push([response.status, await response.text()]);
        }
    };
    await Promise.all(Array.from({length: 6}, next));
    return answers;
}"""


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HostileSite]:
    with serve_hostile(tmp_path_factory.mktemp("hostile")) as hostile:
        yield hostile


@pytest.fixture(scope="module")
def site(hostile: HostileSite) -> Site:
    return hostile.site


@pytest.fixture
def page(open_context: OpenContext) -> Iterator[Page]:
    """A window in which nothing runs, opens or is stopped."""
    page = open_context(expected=REFUSED, **DESKTOP).new_page()
    dialogs = listen(page.context)
    yield page
    assert dialogs == []
    page.close()


def listen(context: BrowserContext) -> list[str]:
    """Collect the dialogs that open."""
    dialogs: list[str] = []
    context.add_init_script(COUNT_HITS)

    def close(dialog: Dialog) -> None:
        dialogs.append(dialog.message)
        dialog.dismiss()

    context.on("dialog", close)
    return dialogs


def read(page: Page, documents: Sequence[str] | None = None) -> Mapping[str, Any]:
    """Read the open page, or documents as this browser would parse them."""
    found: Mapping[str, Any] = page.evaluate(READ, documents)
    return found


def texts_of(page: Page, documents: Sequence[str] | None = None) -> str:
    """Return all that stands on a page, on which nothing hostile may have come to life."""
    found = read(page, documents)
    assert (found["marked"], found["hits"]) == (0, 0), page.url
    return shown(found["text"])


def missing(payloads: Iterable[str], text: str) -> list[str]:
    """Return the payloads that are not shown as they were written."""
    return [payload for payload in payloads if shown(as_read(payload)) not in text]


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
    page.goto("/researcher/unblind")
    if page.get_by_label("Reason").is_visible():
        page.get_by_label("Reason").fill(PAYLOADS[0])
        page.get_by_label("Your password").fill(hostile.site.password)
        page.get_by_role("button", name="Unblind me").click()
        page.get_by_role("heading", name="Results").wait_for()
    page.goto("/researcher/data")
    texts_of(page)
    assert page.locator("img.flow").evaluate("async image => { await image.decode(); return image.naturalWidth; }") > 0
    ((status, figure),) = page.evaluate(FETCH, ["/researcher/consort.svg"])
    drawn = ET.fromstring(figure)  # noqa: S314 - ours, and what is wrong with it is to be found here
    assert status == 200
    assert all(MARKER not in element.attrib for element in drawn.iter())
    assert "<img src=x data-xss" in "".join(drawn.itertext())
    page.goto("/researcher/results")
    texts_of(page)


def test_what_stands_in_an_address_is_shown_as_a_text_or_not_at_all(page: Page, hostile: HostileSite) -> None:
    page.goto("/?lang=en")
    ids = page.evaluate(FETCH, [f"/?PROLIFIC_PID={in_address(text)}" for text in PAYLOADS])
    assert {status for status, _ in ids} == {400}
    told = texts_of(page, [html for _, html in ids])
    assert missing([as_quoted(text).strip()[:64] for text in PAYLOADS], told) == []
    open_ones = ["/?lang={}", "/ask?layout={}", "/ask?layout=experiment1-a&route={}", "/{}", "/resume/{}", "/study/{}"]
    sign_in(page, hostile.site)
    closed = ["/people?search={}", "/people?state={}", "/people/{}", "/{}.csv", "/records?show={}", "/study?version={}"]
    places = [*open_ones, *(f"/researcher{path}" for path in closed)]
    paths = [places[(number + shift) % len(places)].format(in_address(text)) for shift in (0, 5)
             for number, text in enumerate(PAYLOADS)]  # fmt: skip
    answers = page.evaluate(FETCH, paths)
    assert {status for status, _ in answers} <= {200, 400, 403, 404, 422}
    texts_of(page, [html for _, html in answers])
    for text in fitting(32)[:12]:
        page.goto(f"/researcher/people?search={in_address(text)}")
        assert missing([text], texts_of(page)) == []
    for place in places:
        page.goto(place.format(in_address("\"'><img src=x data-xss onerror=hit(1)>")))
        texts_of(page)


def test_what_stands_in_a_header_or_a_form_is_shown_as_a_text_or_not_at_all(page: Page, hostile: HostileSite) -> None:
    page.goto("/?lang=en")
    answers = []
    address = hostile.site.address.removeprefix("http://")
    for text in PAYLOADS:
        value = as_sent(text).replace(b"\r", b" ").replace(b"\n", b" ").replace(b"\0", b" ").decode("latin-1")
        names = ("User-Agent", "Accept-Language", "Referer", "Cookie", "X-Forwarded-For", "X-Forwarded-Host")
        headers = dict.fromkeys(names, value) | {"Cookie": f"participant={value}; notice={value}; session={value}"}
        connection = http.client.HTTPConnection(address, timeout=30)
        connection.request("GET", "/", headers=headers)
        response = connection.getresponse()
        answers.append(response.read().decode())
        assert response.status in {200, 303, 400, 431}, (text, response.status)
        assert "evil" not in str(response.headers)
        connection.close()
    texts_of(page, answers)
    app = create_app(Config(hostile.site.instance))
    refused = [sign_in_as(Visitor(app), text, "not this one") for text in fitting(64)[:5]]
    services_of(app).database.close()
    assert missing(fitting(64)[:5], texts_of(page, [answer.text for answer in refused])) == []


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
