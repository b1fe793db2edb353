"""Send many participants through a running server at once, and compare what is stored with what was acknowledged.

Every participant keeps a ledger of the answers whose acknowledgement (the redirect) has arrived, sends some pages
twice, and at the end the ledger and `ratings.csv` must agree: nothing lost, changed, doubled or invented.

    python -m tests.benchmarks.soak [--participants 200] [--at-once 16]
"""

import argparse
import http.client
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from statistics import quantiles
from urllib.parse import urlencode, urlsplit

from tests.browser.site import STUDY, Row, Site, serve
from tests.conftest import ROOT
from tests.web.people import NUM_PAGES, SAME_SITE, filled
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build

SEE_OTHER = 303
RESEND_SHARE = 0.2


@dataclass
class Visitor:
    """One browser on a connection of its own.

    Attributes:
        address: Host and port.
        rng: Decides what is answered and what is sent twice.
        ledger: The ratings that were acknowledged, by page.
        seconds: How long each request took.
    """

    address: str
    rng: random.Random
    ledger: dict[int, dict[str, str]] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    cookie: str = ""

    def __post_init__(self) -> None:
        self.connection = http.client.HTTPConnection(self.address, timeout=60)

    def complete(self) -> "Visitor":
        """Go from the consent to the thanks."""
        self._send("/consent", {"agree": "yes", "nonce": _nonce(self._ask("GET", "/")[1])})
        for number in range(1, NUM_PAGES + 1):
            address = f"/study/{number}"
            form = filled(number, _nonce(self._ask("GET", address)[1]))
            ratings = {name: str(self.rng.randint(1, 5)) for name in form if name.startswith("rating-")}
            self._send(address, form | ratings)
            self.ledger[number] = {name.removeprefix("rating-"): rating for name, rating in ratings.items()}
            if self.rng.random() < RESEND_SHARE:
                self._send(address, form | dict.fromkeys(ratings, "3"))
        self.connection.close()
        return self

    def _send(self, path: str, form: dict[str, str]) -> None:
        status, _ = self._ask("POST", path, urlencode(form))
        if status != SEE_OTHER:
            raise AssertionError(f"{path} was answered with {status}")

    def _ask(self, method: str, path: str, body: str | None = None) -> tuple[int, str]:
        headers = {**SAME_SITE, "Cookie": self.cookie, "Content-Type": "application/x-www-form-urlencoded"}
        began = time.perf_counter()
        self.connection.request(method, path, body, headers)
        response = self.connection.getresponse()
        text = response.read().decode()
        self.seconds.append(time.perf_counter() - began)
        for cookie in response.headers.get_all("Set-Cookie") or []:
            if cookie.startswith("participant="):
                self.cookie = cookie.partition(";")[0]
        return response.status, text


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the soak and return 0 if the data are what was acknowledged."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--participants", type=int, default=200)
    parser.add_argument("--at-once", type=int, default=16)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        built, instance = Path(scratch, "built"), Path(scratch, "instance")
        instance.mkdir()
        build(ROOT / "webapp/studies" / STUDY, built, lambda _doing, _done: None, agents=planner_agents)
        with serve(built, instance) as site:
            return _soak(site, options.participants, options.at_once)


def _soak(site: Site, num_participants: int, at_once: int) -> int:
    visitors = [Visitor(urlsplit(site.address).netloc, random.Random(number)) for number in range(num_participants)]
    began = time.perf_counter()
    with ThreadPoolExecutor(at_once) as pool:
        visitors = list(pool.map(Visitor.complete, visitors))
    took = time.perf_counter() - began
    seconds = [second for visitor in visitors for second in visitor.seconds]
    centiles = quantiles(seconds, n=100)
    print(f"{num_participants} participants, {at_once} at once, {len(seconds)} requests in {took:.1f} s")
    print("milliseconds: " + ", ".join(f"p{at} {1000 * centiles[at - 1]:.0f}" for at in (50, 95, 99)))
    problems = compare(visitors, site.export("ratings.csv"))
    print(*problems or ["Nothing lost, changed, doubled or invented."], sep="\n")
    return 1 if problems else 0


def compare(visitors: Sequence[Visitor], rows: Sequence[Row]) -> list[str]:
    """Return how the stored ratings differ from the acknowledged ones: participants by the set of their answers."""
    acknowledged = Counter(
        tuple(
            sorted(
                (str(number), item, rating) for number, page in visitor.ledger.items() for item, rating in page.items()
            )
        )
        for visitor in visitors
    )
    by_participant: dict[str, list[tuple[str, str, str]]] = {}
    for row in rows:
        by_participant.setdefault(row["participant"], []).append((_page(row), row["item"], row["rating"]))
    stored = Counter(tuple(sorted(answers)) for answers in by_participant.values())
    lost, invented = acknowledged - stored, stored - acknowledged
    return [f"not stored as acknowledged: {answers}" for answers in lost] + [
        f"stored, but never sent like this: {answers}" for answers in invented
    ]


def _page(row: Row) -> str:
    """Return the number of a rating page: 3, 5, 7 in Experiment 1, then 9 and 11."""
    first = {"1": 3, "2": 9}[row["experiment"]]
    return str(first + 2 * (int(row["trial"]) - 1))


def _nonce(page: str) -> str:
    return page.partition('name="nonce" value="')[2].partition('"')[0]


if __name__ == "__main__":
    sys.exit(main())
