"""Whatever a request holds: nothing of it becomes an address, a header or another host."""

import re
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.security.routes import CASES, EVERYBODY, Case, Who
from tests.security.stages import Running, filled, prepare
from tests.security.strict import faults
from tests.web.people import SAME_SITE

ADDRESSES = (
    "https://evil.example/",
    "//evil.example",
    "/\\evil.example",
    "\\\\evil.example",
    "javascript:alert(1)",
    "http:evil.example",
    "/%2f/evil.example",
    "\r\nLocation: https://evil.example",
    "/study/1\r\nSet-Cookie: participant=x",
    "https://localhost@evil.example",
    "evil.example/../..",
    "\t//evil.example",
)
NAMES = (
    "next",
    "url",
    "return",
    "redirect",
    "return_to",
    "done",
    "lang",
    "language",
    "version",
    "mode",
    "show",
    "page",
    "session",
    "name",
    "PROLIFIC_PID",
    "STUDY_ID",
    "SESSION_ID",
    "id",
    "label",
    "draw",
    "in-1",
    "from",
    "action",
)
FORWARDED = (
    "X-Forwarded-Host",
    "X-Forwarded-Server",
    "X-Host",
    "X-Original-URL",
    "X-Rewrite-URL",
    "X-Forwarded-Prefix",
    "X-Forwarded-For",
    "X-Forwarded-Proto",
    "X-Real-IP",
    "Forwarded",
    "X-Script-Name",
    "X-User-ID",
    "Referer",
)
OUTSIDE = st.sampled_from(ADDRESSES) | st.text(max_size=40)
FIELDS = st.dictionaries(st.sampled_from(NAMES) | st.text(max_size=12), OUTSIDE, max_size=4)


pytestmark = pytest.mark.sqlite_only("everything that the file holds is compared")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("requests")
    one = Running(prepare("rating", folder / "stage"), folder / "copy")
    yield one
    one.close()


def leads_elsewhere(location: str) -> bool:
    parts = urlsplit(location)
    is_own = location.startswith("/") and not location.startswith(("//", "/\\"))
    return bool(parts.netloc or parts.scheme) or not is_own or bool(re.search(r"[\x00-\x1f\\]", location))


@settings(max_examples=40)
@given(data=st.data())
def test_no_redirect_leads_where_a_request_says(running: Running, data: st.DataObject) -> None:
    case: Case = data.draw(st.sampled_from([case for case in CASES if case.stage == "rating"]))
    who: Who = data.draw(st.sampled_from(EVERYBODY))
    query, form = data.draw(FIELDS), data.draw(FIELDS)
    said = data.draw(st.dictionaries(st.sampled_from(FORWARDED), st.sampled_from(ADDRESSES[:8:2]), max_size=3))
    known = {name: filled(value, running.prepared.words) for name, value in case.form.items()}
    sent = {**form, **known} if case.method == "POST" else None
    answer = running.client(who).open(
        filled(case.address, running.prepared.words),
        method=case.method,
        query_string=query,
        data=sent,
        headers=SAME_SITE | said,
    )
    location = answer.headers.get("Location")
    assert answer.status_code < 500
    assert location is None or not leads_elsewhere(location), (case.name, location)
    assert "evil.example" not in str(answer.headers).replace("%2F", "").partition("Location")[0]
    assert not [name for name in dict(answer.headers) if "\n" in name or "\r" in name]
    if running.has_changed():
        assert "+" in case.said[who]


@pytest.mark.parametrize(
    "location", ["https://evil.example", "//evil.example", "/\\evil.example", "evil", "/a\nb", "x:y"]
)
def test_an_address_that_leads_elsewhere_is_known_as_such(location: str) -> None:
    """The control."""
    assert leads_elsewhere(location)
    assert not leads_elsewhere("/study/3")


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "localhost.evil.example",
        "evil.example:80",
        "localhost:80@evil.example",
        "localhost\tevil.example",
        "",
        "127.0.0.1.nip.io",
    ],
)
def test_another_name_of_the_server_is_refused_everywhere(running: Running, host: str) -> None:
    for case in CASES:
        address = filled(case.address, running.prepared.words)
        answer = running.client("A").open(address, method=case.method, headers=SAME_SITE | {"Host": host})
        assert answer.status_code == 400, (case.name, host)
        assert host == "" or host not in answer.text
        assert faults(answer) == []
    assert not running.has_changed()


@pytest.mark.parametrize("path", ["/consent", "/researcher/unblind", "/%00", "/nowhere%00", "/static/x"])
def test_another_name_is_refused_before_anything_else_is(running: Running, path: str) -> None:
    for method in ("POST", "GET", "PUT"):
        answer = running.client("owner").open(path, method=method, headers={"Host": "evil.example"})
        assert (answer.status_code, answer.text) == (400, "This server has another name.\n")


@pytest.mark.parametrize("name", FORWARDED)
def test_what_a_proxy_would_say_is_not_taken_from_anybody(running: Running, name: str) -> None:
    plain = running.client("A").get("/another-device").text
    told = running.client("A").get("/another-device", headers={name: "for=evil.example;host=evil.example"}).text
    assert told == plain
    assert 'value="http://localhost/resume/' in plain or "http://localhost/resume/" in plain
