"""Hostile texts in links, headers, cookies, forms and files that are sent, on the pages that show them.

Of addresses, of which there are thousands, some are visited, and the answers to all are parsed by the same browser.
"""

import http.client
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.browser.hostile_windows import FETCH, SEND_FILES, missing, texts_of
from tests.browser.researcher import sign_in
from tests.browser.site import Site, serve
from tests.security.payload_families import MARKER
from tests.security.payloads import PAYLOADS, as_quoted, as_read, as_sent, fitting, in_address
from tests.web.bundles import write_bundle
from tests.web.people import SAME_SITE, Visitor
from tests.web.researchers import sign_in as sign_in_as
from tests.web.studies import PROLIFIC, a_study
from webapp.app import create_app
from webapp.config import Config
from webapp.views.services import services_of

_IDS = {"PROLIFIC_PID": "0" * 24, "STUDY_ID": "1" * 24, "SESSION_ID": "2" * 24}
_HEADERS = ("User-Agent", "Accept-Language", "Referer", "X-Forwarded-For", "X-Forwarded-Host")
_KEPT = ("ratings", "answers", "participants", "recruits", "records")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("requests")
    study = a_study(recruitment=PROLIFIC)
    write_bundle(folder / "built", study)
    (folder / "instance").mkdir()
    with serve(folder / "built", folder / "instance", study.name) as site:
        yield site


@pytest.mark.parametrize("name", _IDS)
def test_what_is_wrong_in_a_recruiters_link_is_shown_as_a_text(page: Page, name: str) -> None:
    page.goto("/?lang=en")
    known = "&".join(f"{other}={value}" for other, value in _IDS.items() if other != name)
    answers = page.evaluate(FETCH, [f"/?{known}&{name}={in_address(text)}" for text in PAYLOADS])
    assert {status for status, _ in answers} == {400}
    told = texts_of(page, [html for _, html in answers])
    assert missing([as_quoted(text).strip()[:64] for text in PAYLOADS], told) == []
    for text in PAYLOADS[:10]:
        page.goto(f"/?{known}&{name}={in_address(text)}")
        texts_of(page)


@pytest.mark.parametrize(("service", "name"), [("sona", "id"), ("label", "label")])
def test_so_it_is_in_links_of_other_recruiters(page: Page, tmp_path: Path, service: str, name: str) -> None:
    write_bundle(tmp_path, a_study(recruitment=PROLIFIC | {"service": service}))
    visitor = Visitor(create_app(Config(tmp_path)))
    answers = [visitor.get(f"/?{name}={in_address(text)}") for text in PAYLOADS]
    services_of(visitor.app).database.close()
    refused = [text for text, answer in zip(PAYLOADS, answers, strict=True) if answer.status_code == 400]
    assert len(refused) >= 200
    page.goto("/?lang=en")
    told = texts_of(page, [answer.text for answer in answers])
    assert missing([as_quoted(text).strip()[:64] for text in refused], told) == []


def test_what_a_link_says_besides_is_shown_nowhere(page: Page) -> None:
    page.goto("/?lang=en")
    names = ("ref", "utm_source", "gclid", "next")
    paths = [f"/?{names[number % 4]}={in_address(text)}" for number, text in enumerate(PAYLOADS)]
    paths += [f"/?{in_address(text)}=ref" for text in PAYLOADS]
    answers = page.evaluate(FETCH, paths)
    assert {status for status, _ in answers} == {200}
    assert MARKER not in texts_of(page, [html for _, html in answers])
    for path in paths[::40]:
        page.goto(path)
        assert page.url.endswith("/")
        assert MARKER not in texts_of(page)


def test_what_stands_in_an_address_is_shown_as_a_text_or_not_at_all(page: Page, site: Site) -> None:
    open_ones = ["/?lang={}", "/ask?layout={}", "/ask?layout=experiment1-a&route={}", "/{}", "/resume/{}", "/study/{}"]
    sign_in(page, site)
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


def test_what_stands_in_a_header_or_a_form_is_shown_as_a_text_or_not_at_all(page: Page, site: Site) -> None:
    page.goto("/?lang=en")
    answers = []
    for text in PAYLOADS:
        value = _as_header(text)
        headers = dict.fromkeys(_HEADERS, value) | {"Cookie": f"participant={value}; notice={value}; session={value}"}
        status, said, html = _ask(site, "GET", "/", headers)
        assert status in {200, 303, 400, 431}, (text, status)
        assert "evil" not in said
        answers.append(html)
    texts_of(page, answers)
    app = create_app(Config(site.instance))
    refused = [sign_in_as(Visitor(app), text, "not this one") for text in fitting(64)[:5]]
    services_of(app).database.close()
    assert missing(fitting(64)[:5], texts_of(page, [answer.text for answer in refused])) == []


def test_browsers_and_languages_of_participants_are_kept_nowhere_and_shown_nowhere(page: Page, site: Site) -> None:
    path, begun = site.instance / "xar.sqlite3", 0
    for number, text in enumerate(PAYLOADS):
        headers = dict.fromkeys(_HEADERS, _as_header(text)) | SAME_SITE
        form = f"agree=yes&nonce={number:032x}"
        status, *_ = _ask(site, "POST", "/consent", headers, form)
        assert status in {303, 400, 431}, (text, status)
        begun += status == 303
    assert begun >= 200
    with closing(sqlite3.connect(path, timeout=10)) as connection:
        rows = [str(row) for name in _KEPT for row in connection.execute(f"SELECT * FROM {name}")]  # noqa: S608
        (code,) = connection.execute("SELECT code FROM participants LIMIT 1").fetchone()
    assert len(rows) >= 2 * begun
    assert not [row for row in rows if MARKER in row or "evil.invalid" in row]
    sign_in(page, site)
    shown = ("", "people", "people?page=2", f"people/{code}", "records", "quality", "allocation", "accounts")
    for place in shown:
        page.goto(f"/researcher/{place}")
        told = texts_of(page)
        assert MARKER not in told, place
        assert "evil.invalid" not in told, place


def test_whats_wrong_in_a_recruiters_list_is_shown_as_a_text(page: Page, site: Site) -> None:
    sign_in(page, site)
    page.goto("/researcher/data")
    for head, quoted in (("{},Status", True), ("Participant id,Status\nx,{}", False), ("Participant id\n,{}", False)):
        contents = [head.format(_in_csv(text)).encode("utf-8", "surrogateescape") for text in PAYLOADS]
        answers = _send_lists(page, contents, PAYLOADS)
        told = texts_of(page, [html for _, html in answers])
        refused = [text for text, (status, _) in zip(PAYLOADS, answers, strict=True) if status == 422]
        assert {status for status, _ in answers} <= {200, 422}
        if quoted:
            # Headings are quoted as Python writes them; what is no UTF-8 is refused as such.
            texts = [repr(text.strip()) for text in refused if as_read(text) == text]
            assert len(texts) >= 200
            assert missing(texts, told) == []
            assert len(refused) == len(PAYLOADS)
    # In a file whose name is hostile, by hand.
    page.get_by_label("The list, a CSV file").set_input_files(
        {"name": f"<img src=x {MARKER} onerror=hit(1)>.csv", "mimeType": "text/csv", "buffer": b"<b data-xss>,y\n1,2"}
    )
    page.get_by_role("button", name="Compare").click()
    page.locator(".field-error").wait_for()
    assert missing(["<b data-xss>"], texts_of(page)) == []


def _send_lists(page: Page, contents: Sequence[bytes], names: Sequence[str]) -> Sequence[tuple[int, str]]:
    files = [[list(content), name.encode("utf-8", "replace").decode()] for content, name in
             zip(contents, names, strict=True)]  # fmt: skip
    found: Sequence[tuple[int, str]] = page.evaluate(SEND_FILES, ["/researcher/reconcile", "list", files])
    return found


def _in_csv(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def _as_header(text: str) -> str:
    value = as_sent(text).replace(b"\r", b" ").replace(b"\n", b" ").replace(b"\0", b" ")
    return value.decode("latin-1")


def _ask(site: Site, method: str, path: str, headers: Mapping[str, str], form: str = "") -> tuple[int, str, str]:
    """Send a request as it is given, and return status, headers and content of the answer."""
    connection = http.client.HTTPConnection(site.address.removeprefix("http://"), timeout=30)
    kind = {"Content-Type": "application/x-www-form-urlencoded"} if form else {}
    connection.request(method, path, body=form or None, headers={**headers, **kind})
    response = connection.getresponse()
    content = response.read().decode()
    connection.close()
    return response.status, str(response.headers), content
