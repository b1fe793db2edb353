"""Pages with nothing behind them: for what the scripts do however the server answers and the network fails."""

import json
import struct
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs

from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from tests.conftest import ROOT
from webapp.stimuli.catalogue import Frame, Strip
from webapp.views.security import CONTENT_SECURITY_POLICY

TYPES = {"css": "text/css", "js": "text/javascript", "png": "image/png", "svg": "image/svg+xml"}

PAGE = """{% from "macros/rating_item.html" import rating_item with context %}
{% from "macros/strips.html" import current_view, explanation with context %}
{% from "macros/player.html" import player with context %}
<!doctype html>
<html lang="{{ language }}"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Page</title><link rel="icon" href="/static/favicon.svg"><script src="/static/js/early.js"></script>
{% for name in ("base", "controls", "participant", "pictures", "player", "rating", "questions", "drive") %}
<link rel="stylesheet" href="/static/css/{{ name }}.css">{% endfor %}
<script type="module" src="/static/js/participant.js"></script></head>
<body{% if behaviour %} data-behaviour{% endif %}><main id="main" class="site-main site-main--wide"><h1>Page</h1>
{{ CONTENT }}</main></body></html>"""

FORM = """<form class="page-form" method="post" action="/send" novalidate data-guard data-send data-nonce="n1"
 {% if timed %}data-timed="n1"{% endif %} data-offline="You are offline." data-retrying="We try again.">
<input type="hidden" name="nonce" value="n1"><input type="hidden" name="events" value="">
{% for item in items %}{{ rating_item(item) }}{% endfor %}{{ fields }}
<div class="actions"><button class="button" type="submit" data-sending="Sending">Send</button></div></form>"""


@dataclass(frozen=True, slots=True)
class Item:
    """What a rating item is drawn from."""

    id: str
    legend: str
    points: int = 5
    low: str = "Not at all"
    high: str = "Completely"
    labels: tuple[str, ...] | None = None
    value: int | None = None
    error: str | None = None


@dataclass(frozen=True, slots=True)
class Sent:
    """A form that came in.

    Attributes:
        path: Where to.
        fields: What it held.
        by_script: Whether an address was asked for rather than a page.
    """

    path: str
    fields: dict[str, str]
    by_script: bool

    @property
    def events(self) -> list[list[object]]:
        """The log that came with it."""
        events: list[list[object]] = json.loads(self.fields["events"])
        return events

    def named(self, *names: str) -> list[list[object]]:
        """The events with one of these names, without their times."""
        return [event[:3] for event in self.events if event[0] in names]


@dataclass(frozen=True, slots=True)
class Reply:
    """What is answered: a JSON object, or a page with this heading."""

    status: int = 200
    content: object = field(default_factory=lambda: {"next": "/next"})


Answer = Callable[[Sent], Reply]


def go_on(sent: Sent) -> Reply:
    """Answer as the real server does once something is stored."""
    return Reply() if sent.by_script else Reply(HTTPStatus.SEE_OTHER, "/next")


class SmallSite:
    """A server that shows one page at `/` and a heading everywhere else.

    Attributes:
        address: Without a slash at the end.
        page: The page.
        sent: Every form that came in, in order.
        answer: What is answered to a form.
        pictures: How to answer the request for a picture by its name: how often it fails first.
        gate: Pictures wait until it is open.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.renew()

    def renew(self) -> None:
        """Forget everything."""
        self.page = ""
        self.sent: list[Sent] = []
        self.answer: Answer = go_on
        self.pictures: dict[str, int] = {}
        self.gate = threading.Event()
        self.gate.set()

    def show(self, content: str, **values: object) -> None:
        """Put a page at `/`: `content` is a template that may use the macros of the real pages."""
        environment = Environment(loader=FileSystemLoader(ROOT / "templates"), autoescape=True)
        environment.globals.update(t=_text, url_for=lambda _, digest: f"/pictures/{digest}.png")
        values = {"language": "en", "behaviour": False, "timed": True, "items": (), **values}
        template = PAGE.replace("{{ CONTENT }}", content.replace("{{ FORM }}", FORM))
        self.page = environment.from_string(template).render(**values)


def strip(*names: str) -> Strip:
    """Pictures with these names, `go on` between them."""
    return Strip(tuple(Frame(name, f"The agent sees {name}.") for name in names), ("go on",) * (len(names) - 1))


def items(*names: str) -> Sequence[Item]:
    """Items with these ids."""
    return [Item(name, f"How {name} is it?") for name in names]


def markup(html: str) -> Markup:
    """HTML for a template."""
    return Markup(html)  # noqa: S704 - It stands in the tests.


def _text(key: str, /, **values: object) -> str:
    if key == "loading.progress":
        return f"Loading pictures: {values['number']} of {values['total']}"
    return " ".join([key, *map(str, values.values())])


@contextmanager
def serve_small() -> Iterator[SmallSite]:
    """Serve such a site as long as the context lasts."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Handler)
    server.daemon_threads = True
    site = SmallSite(f"http://127.0.0.1:{server.server_address[1]}")
    server.site = site  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    try:
        yield site
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        site = self._site
        folder, _, name = self.path.strip("/").partition("/")
        if folder == "static":
            self._reply((ROOT / self.path.strip("/")).read_bytes(), TYPES[name.rpartition(".")[2]])
        elif folder == "pictures":
            site.gate.wait(30)
            missing = site.pictures.get(name, 0)
            site.pictures[name] = missing - 1
            self._reply(b"" if missing > 0 else _png(len(name)), "image/png", 503 if missing > 0 else 200)
        else:
            page = site.page if self.path == "/" else f"<!doctype html><title>x</title><h1>{self.path}</h1>"
            self._reply(page.encode(), "text/html; charset=utf-8")

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"])).decode()
        fields = {name: values[-1] for name, values in parse_qs(body, keep_blank_values=True).items()}
        sent = Sent(self.path, fields, self.headers["Accept"] == "application/json")
        self._site.sent.append(sent)
        reply = self._site.answer(sent)
        if reply.status == HTTPStatus.SEE_OTHER:
            self._reply(b"", "text/plain", reply.status, Location=str(reply.content))
        elif isinstance(reply.content, str):
            page = f"<!doctype html><title>x</title><h1>{reply.content}</h1>"
            self._reply(page.encode(), "text/html; charset=utf-8", reply.status)
        else:
            self._reply(json.dumps(reply.content).encode(), "application/json", reply.status)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""

    @property
    def _site(self) -> SmallSite:
        site: SmallSite = self.server.site  # type: ignore[attr-defined]
        return site

    def _reply(self, content: bytes, kind: str, status: int = 200, **headers: str) -> None:
        headers = {"Content-Security-Policy": CONTENT_SECURITY_POLICY, "Cache-Control": "no-store", **headers}
        try:
            self.send_response(status)
            for name, value in {"Content-Type": kind, "Content-Length": str(len(content)), **headers}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content)
        except (BrokenPipeError, ConnectionResetError):
            return  # The browser has gone on; that is what some tests are about.


def _png(shade: int) -> bytes:
    """A grey picture of one pixel."""
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(bytes((0, shade)))),
        (b"IEND", b""),
    )
    parts = (
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)
