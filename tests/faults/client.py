"""Participants with patience: whatever happens to the server, they send the same form again until it is answered."""

import http.client
import random
import time
from dataclasses import dataclass, field
from urllib.parse import urlencode

from tests.faults.oracle import Ledger, Sheet
from tests.web.people import NUM_PAGES, SAME_SITE, filled
from webapp.storage.participants import hash_token

_SEE_OTHER, _OK, _FAILED = 303, 200, 500
_PAUSE_S = 0.05


class GaveUp(Exception):
    """The server does not come back, or has forgotten where somebody was."""


@dataclass
class Browser:
    """One browser.

    Attributes:
        port: Where the server listens, on this machine.
        patience_s: For how long it asks again.
        cookies: By name.
        num_again: How often it had to ask again.
        statuses: Every status above 499 that it was answered with.
    """

    port: int
    patience_s: float = 30.0
    cookies: dict[str, str] = field(default_factory=dict)
    num_again: int = 0
    statuses: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=self.patience_s)

    def ask(self, path: str, form: dict[str, str] | None = None) -> tuple[int, http.client.HTTPMessage, str]:
        """Ask until there is an answer that is no failure."""
        ends_at = time.monotonic() + self.patience_s
        while time.monotonic() < ends_at:
            try:
                status, headers, text = self.ask_once(path, form)
            except (OSError, http.client.HTTPException):
                self._connection.close()
            else:
                if status < _FAILED:
                    return status, headers, text
                self.statuses.add(status)
            self.num_again += 1
            time.sleep(_PAUSE_S)
        raise GaveUp(f"{path} was not answered within {self.patience_s} s")

    def ask_once(self, path: str, form: dict[str, str] | None = None) -> tuple[int, http.client.HTTPMessage, str]:
        """Ask once."""
        cookies = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        headers = {**SAME_SITE, **({"Cookie": cookies} if cookies else {})}
        if form is None:
            self._connection.request("GET", path, headers=headers)
        else:
            headers["Content-Type"] = "application/x-www-form-urlencoded"
            self._connection.request("POST", path, urlencode(form), headers)
        response = self._connection.getresponse()
        text = response.read().decode()
        for line in response.headers.get_all("Set-Cookie") or []:
            name, _, value = line.partition(";")[0].partition("=")
            self.cookies[name] = value
        return response.status, response.headers, text

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def nonce_of(self, path: str) -> str:
        """Return the nonce of a page's form; it may take a moment until a page is somebody's turn."""
        ends_at = time.monotonic() + min(3.0, self.patience_s)
        while time.monotonic() < ends_at:
            status, _, text = self.ask(path)
            if status == _OK:
                return text.partition('name="nonce" value="')[2].partition('"')[0]
            time.sleep(_PAUSE_S)
        raise GaveUp(f"{path} is not shown")

    @property
    def token_hash(self) -> str:
        """Whose browser it is."""
        return hash_token(self.cookies["participant"])


def take_part(browser: Browser, ledger: Ledger, rng: random.Random, last: int = NUM_PAGES) -> None:
    """Agree and send pages up to one, writing down what is sent and what was acknowledged."""
    form = {"agree": "yes", "nonce": browser.nonce_of("/")}
    _accepted(browser, "/consent", form)
    consent = Sheet((browser.token_hash, 0), "")
    ledger.send(consent)
    ledger.acknowledge(consent)
    for number in range(1, last + 1):
        send_page(browser, ledger, rng, number)


def send_page(browser: Browser, ledger: Ledger, rng: random.Random, number: int) -> None:
    """Send one page with random ratings."""
    path = f"/study/{number}"
    form = filled(number, browser.nonce_of(path))
    form |= {name: str(rng.randint(1, 5)) for name in form if name.startswith("rating-")}
    ratings = tuple(sorted((name[7:], int(value)) for name, value in form.items() if name.startswith("rating-")))
    sheet = Sheet((browser.token_hash, number), form["nonce"], ratings)
    ledger.send(sheet)
    _accepted(browser, path, form)
    ledger.acknowledge(sheet)


def _accepted(browser: Browser, path: str, form: dict[str, str]) -> None:
    status, _, _ = browser.ask(path, form)
    if status != _SEE_OTHER:
        raise GaveUp(f"{path} was answered with {status}")
