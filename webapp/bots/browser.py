"""A browser as small as a bot needs: it keeps cookies and connections, follows redirects and tries again if told to."""

import json
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from http import HTTPStatus
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import urlencode, urlsplit

import urllib3

from webapp.bots.errors import OutOfTimeError, WalkError

_FORM = {"Sec-Fetch-Site": "same-origin", "Content-Type": "application/x-www-form-urlencoded"}
_PATIENCE_S = (0.1, 0.3, 1.0, 3.0)
"""How long to wait before each new try after the server was busy or the connection broke."""

_MAX_REDIRECTS = 5
_REQUEST_TIMEOUT_S = 30.0


@dataclass(frozen=True, slots=True)
class Site:
    """A server to talk to.

    Attributes:
        host: Its address on this machine.
        port: Its port.
        name: What the `Host` of a request says.
    """

    host: str
    port: int
    name: str


class TimeLimit:
    """The time that one bot has, and the wish of the whole run to stop."""

    def __init__(self, seconds: float, stop: threading.Event) -> None:
        self._ends_at = time.monotonic() + seconds
        self._stop = stop

    def left(self) -> float:
        """Return the seconds that are left.

        Raises:
            OutOfTimeError: There are none, or everybody is to stop.
        """
        left = self._ends_at - time.monotonic()
        if left <= 0 or self._stop.is_set():
            raise OutOfTimeError("the time is over")
        return left

    def wait(self, seconds: float) -> None:
        """Wait, but not beyond the limit.

        Raises:
            OutOfTimeError: As `left`.
        """
        self._stop.wait(min(seconds, self.left()))
        self.left()


@dataclass(frozen=True, slots=True)
class Answer:
    """What the server answered.

    Attributes:
        path: What was asked for.
        status: The HTTP status.
        text: The body.
        next: The path that a redirect leads to, or that a script is told; None where it leads nowhere.
        is_busy: Whether the server asks to be asked again later.
    """

    path: str
    status: int
    text: str
    next: str | None
    is_busy: bool = False

    def content(self) -> Mapping[str, Any]:
        """Return the JSON object that a script was sent; empty for anything else."""
        try:
            content = json.loads(self.text)
        except ValueError:
            return {}
        return content if isinstance(content, dict) else {}


class Browser:
    """The browser of one bot. Two threads may send at the same time, each over a connection of its own.

    Attributes:
        cookies: By name.
        all_cookies: Every name and value that there has been.
        num_requests: How many requests were answered.
    """

    def __init__(self, site: Site, limit: TimeLimit) -> None:
        self.cookies: dict[str, str] = {}
        self.all_cookies: set[tuple[str, str]] = set()
        self.num_requests = 0
        self._site = site
        self._limit = limit
        self._pool = urllib3.HTTPConnectionPool(site.host, site.port, maxsize=2)

    def close(self) -> None:
        """Close all connections."""
        self._pool.close()

    def get(self, path: str) -> Answer:
        """Load a page, wherever redirects lead.

        Raises:
            WalkError: It cannot be loaded.
            OutOfTimeError: The time is over.
        """
        answer = self._ask("GET", path)
        for _ in range(_MAX_REDIRECTS):
            if answer.next is None:
                break
            answer = self._ask("GET", answer.next)
        if answer.status != HTTPStatus.OK:
            raise WalkError(f"{answer.path} was answered with {answer.status}")
        return answer

    def post(self, path: str, form: Mapping[str, str], *, as_script: bool = False, **headers: str) -> Answer:
        """Send a form and return the answer as it came.

        Args:
            path: Where to.
            form: The fields.
            as_script: Whether to ask for JSON, as scripts do.
            headers: More of them, with _ for -.

        Raises:
            WalkError: The server does not answer.
            OutOfTimeError: The time is over.
        """
        accept = {"Accept": "application/json"} if as_script else {"Accept": "text/html"}
        more = {name.replace("_", "-"): value for name, value in headers.items()}
        return self._ask("POST", path, form, _FORM | accept | more)

    def _ask(
        self, method: str, path: str, form: Mapping[str, str] | None = None, headers: Mapping[str, str] | None = None
    ) -> Answer:
        """Ask, and ask again where that is what a browser's script does: the same form changes nothing twice."""
        for pause in (*_PATIENCE_S, None):
            try:
                answer = self._ask_once(method, path, form, headers or {})
            except urllib3.exceptions.HTTPError as error:
                if pause is None:
                    raise WalkError(f"{method} {path} got no answer: {error}") from error
            else:
                if not answer.is_busy or pause is None:
                    return answer
            self._limit.wait(pause)
        raise AssertionError("the last try returns or raises")

    def _ask_once(self, method: str, path: str, form: Mapping[str, str] | None, headers: Mapping[str, str]) -> Answer:
        cookies = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        own = {"Host": self._site.name, "Cookie": cookies} if cookies else {"Host": self._site.name}
        response = self._pool.request(
            method,
            path,
            body=None if form is None else urlencode(form),
            headers={**headers, **own},
            redirect=False,
            retries=False,
            timeout=min(_REQUEST_TIMEOUT_S, self._limit.left()),
        )
        self.num_requests += 1
        for line in response.headers.getlist("Set-Cookie"):
            self._keep(line)
        answer = Answer(path, response.status, response.data.decode("utf-8", "replace"), None)
        told = response.headers.get("Location") or answer.content().get("next")
        return replace(answer, next=told and _path_of(told), is_busy="Retry-After" in response.headers)

    def _keep(self, line: str) -> None:
        """Keep a cookie, or forget one that the server takes back."""
        for name, cookie in SimpleCookie(line).items():
            if cookie.value:
                self.cookies[name] = cookie.value
                self.all_cookies.add((name, cookie.value))
            else:
                self.cookies.pop(name, None)


def _path_of(address: str) -> str:
    parts = urlsplit(address)
    return f"{parts.path}?{parts.query}" if parts.query else parts.path
