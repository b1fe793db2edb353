"""Whatever is sent to whichever address by whatever method: no answer is a failure of the server, none is logged."""

import json
import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import get_args
from urllib.parse import quote_from_bytes, urlencode

import pytest
from flask import request
from hypothesis import HealthCheck, Phase, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from tests.security.routes import CASES, EVERYBODY, Case, Stage, Who
from tests.security.stages import Running, filled, prepare
from tests.web.people import SAME_SITE

NUM_EXAMPLES = 6
ONLY_FIND = settings(max_examples=2000, phases=[Phase.generate], suppress_health_check=list(HealthCheck))


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


NAMES = _words(
    "lang language layout route from ask action step elapsed events nonce agree age_group name password reason text "
    "page place value code confirm role session draw search state flagged excluded before show mode version done for "
    "own_words time list rating-general rating-likeliness time-general answer-goal answer-age answer-robots "
    "PROLIFIC_PID STUDY_ID SESSION_ID id label in-1"
)
METHODS = ("GET", "POST", "HEAD", "OPTIONS", "PUT", "DELETE", "PATCH", "TRACE", "CONNECT", "PROPFIND", "get", "\x7f")
HEADERS = _words(
    "Accept Accept-Encoding Accept-Language Authorization Content-Encoding Content-Length Content-Type Cookie Expect "
    "Host If-Match If-Modified-Since If-None-Match If-Range Origin Range Referer Sec-Fetch-Site Transfer-Encoding "
    "User-Agent X-Forwarded-For X-Forwarded-Host X-HTTP-Method-Override X-Requested-With Xar-Bot Xar-Poll"
)
KINDS = (
    "application/x-www-form-urlencoded",
    "application/x-www-form-urlencoded; charset=utf-7",
    "multipart/form-data; boundary=x",
    "multipart/form-data",
    "application/json",
    "text/plain",
    "/;;=",
)
ODD = (
    b"",
    b"\0",
    b"\xff\xfe",
    b"\xc3\x28",
    b"../../etc/passwd",
    b"..\\..\\x",
    b"%00%ff%2e%2e",
    b"-1",
    b"0",
    b"1e999",
    b"9" * 30,
    b"99999999999999999999999999999999999999999999999",
    b"NaN",
    b"\xd9\xa3",
    b"\xe2\x91\xa0",
    b"\xc2\xb2",
    b"true",
    b"null",
    b"[]",
    b"{}",
    b"[[[[",
    b"[" * 4000,
    b'[{"at":-1,"kind":"x"}]',
    b"ratings|1|likeliness",
    b"ratings|x|" + b"|" * 40,
    b"' OR 1=1 --",
    b"{{7*7}}",
    b"%s%n{0}",
    b"2031-02-30T25:61:61Z",
    b"a,b,c\r\n1,2",
    b"\r\nX: y",
    b"a" * 5000,
    b"\xed\xa0\x80",
    b"\xf4\x90\x80\x80",
    "\N{LATIN SMALL LETTER DOTLESS I}\N{COMBINING ACUTE ACCENT}\N{RIGHT-TO-LEFT OVERRIDE}".encode(),
)
TEXT = (
    st.sampled_from(ODD) | st.binary(max_size=20) | st.text(max_size=20).map(lambda text: text.encode(errors="ignore"))
)
FIELD = st.tuples(st.sampled_from([name.encode() for name in NAMES]) | TEXT, TEXT)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)
WORD = re.compile(r"<(?:(\w+):)?\w+>")


@dataclass(frozen=True, slots=True)
class Sent:
    """What somebody sends.

    Attributes:
        method: The method.
        path: In place of each part of the rule that can be anything; None for what the case has there.
        query: The query, encoded.
        fields: Of a form, instead of or besides those of the case.
        dropped: The fields of the case that are left out.
        kind: The type of the body; the first is that of a form.
        raw: The body where it is no form.
        headers: Further headers.
    """

    method: str | None
    path: bytes | None
    query: Sequence[tuple[bytes, bytes]]
    fields: Sequence[tuple[bytes, bytes]]
    dropped: frozenset[str]
    kind: str
    raw: bytes | None
    headers: Mapping[str, str]


def header_values(text: bytes) -> str:
    return re.sub(r"[\r\n\0]", " ", text.decode("latin-1"))


PARTS = b'--x\r\nContent-Disposition: form-data; name="list"; filename="%s"\r\nContent-Type: %s\r\n\r\n%s\r\n--x--\r\n'
SENT = st.builds(
    Sent,
    method=st.none() | st.none() | st.sampled_from(METHODS),
    path=st.none() | st.none() | TEXT,
    query=st.lists(FIELD, max_size=3),
    fields=st.lists(FIELD, max_size=3),
    dropped=st.sets(st.sampled_from(NAMES), max_size=2).map(frozenset),
    kind=st.just(KINDS[0]) | st.sampled_from(KINDS),
    raw=st.none()
    | st.none()
    | TEXT
    | JSON.map(lambda tree: json.dumps(tree).encode())
    | st.tuples(TEXT, TEXT, TEXT).map(lambda parts: PARTS % parts),
    headers=st.dictionaries(st.sampled_from(HEADERS), TEXT.map(header_values), max_size=3),
)


class Stages:
    """An application in each stage, whose errors are collected."""

    def __init__(self, running: Mapping[Stage, Running]) -> None:
        self.running = running
        self.logged: list[str] = []

    def send(self, case: Case, who: Who, sent: Sent) -> int:
        """Send something to the address of a case, and return the status of the answer."""
        running = self.running[case.stage]
        words = running.prepared.words
        address = filled(case.address, words)
        if sent.path is not None:
            address = WORD.sub(quote_from_bytes(sent.path, safe=""), case.rule)
        form = [(name.encode(), filled(value, words).encode()) for name, value in case.form.items()
                if name not in sent.dropped]  # fmt: skip
        method = sent.method or case.method
        body = urlencode([*sent.fields, *form]).encode() if sent.raw is None else sent.raw
        answer = running.client(who).open(
            address + ("?" + urlencode(sent.query) if sent.query else ""),
            method=method,
            headers=SAME_SITE | {"Content-Type": sent.kind} | dict(sent.headers),
            data=body if method not in {"GET", "HEAD"} else None,
            buffered=True,
        )
        running.has_changed()
        return answer.status_code


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stages]:
    folder = tmp_path_factory.mktemp("fuzz")
    with ExitStack() as stack:
        running: dict[Stage, Running] = {}
        for stage in get_args(Stage):
            running[stage] = Running(prepare(stage, folder / stage), folder / f"copy of {stage}")
            stack.callback(running[stage].close)
        found = Stages(running)
        logger, handler = logging.getLogger(), Kept(found.logged)
        logger.addHandler(handler)
        stack.callback(logger.removeHandler, handler)
        yield found


class Kept(logging.Handler):
    """Keeps errors and whatever has a traceback."""

    def __init__(self, lines: list[str]) -> None:
        super().__init__()
        self._lines = lines

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.ERROR or record.exc_info:
            self._lines.append(record.getMessage())


def fails(stages: Stages, case: Case, who: Who, sent: Sent) -> bool:
    """Tell whether the server failed."""
    stages.logged.clear()
    return stages.send(case, who, sent) >= 500 or bool(stages.logged)


@pytest.mark.sqlite_only("everything that the file holds is compared")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_nothing_that_is_sent_is_a_failure_of_the_server(stages: Stages, case: Case) -> None:
    allowed = [who for who in EVERYBODY if case.said[who][0] == "2" or "+" in case.said[who]]

    @settings(max_examples=NUM_EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(st.sampled_from(allowed or EVERYBODY), SENT)
    def look(who: Who, sent: Sent) -> None:
        assert not fails(stages, case, who, sent), stages.logged

    look()


@pytest.mark.sqlite_only("everything that the file holds is compared")
def test_a_view_that_fails_for_some_is_found(stages: Stages) -> None:
    """The control: a page that takes any query for a number, or any header for ASCII."""
    case = next(case for case in CASES if case.rule == "/ask")
    app = stages.running[case.stage].app
    kept = app.view_functions["ask.ask"]
    for spoiled in (
        lambda: str(int(next(iter(request.args.values()), "0"))),
        lambda: str("".join(value for _, value in request.headers).encode("ascii")),
    ):
        app.view_functions["ask.ask"] = spoiled
        try:
            find(SENT, lambda sent: fails(stages, case, "nobody", sent), settings=ONLY_FIND)
        except NoSuchExample:
            pytest.fail("nothing was found")
        finally:
            app.view_functions["ask.ask"] = kept
