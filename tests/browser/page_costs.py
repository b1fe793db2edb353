"""What a page costs whoever opens it with an empty cache: bytes, requests to others, things that move."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, CDPSession, Page

LOOK_MS = 50
MAX_LOOKS = 300
NUM_QUIET_LOOKS = 4
# On a slow phone more time lies between the first paint and what scripts and late styles could move.
_SLOWDOWN = 4
_ADD_UP_SHIFTS = """window.layoutShift = 0;
new PerformanceObserver((list) => list.getEntries().forEach((entry) => (window.layoutShift += entry.value)))
    .observe({ type: "layout-shift", buffered: true });"""


@dataclass(frozen=True, slots=True)
class PageCost:
    """What it took to show a page.

    Attributes:
        kind: What stands on the page; empty where it is none of the study's.
        address: Its path.
        page_bytes: All that came besides the study's pictures, headers included, as it travelled.
        picture_bytes: The study's pictures, headers included.
        foreign: The addresses of other hosts that were asked for something.
        layout_shift: The sum of all layout shifts, in shares of the window, to the thousandth as Lighthouse tells it.
            There is less where the parser pauses within a button, between its arrow and its label.
    """

    kind: str
    address: str
    page_bytes: int
    picture_bytes: int
    foreign: tuple[str, ...]
    layout_shift: float


def weigh(browser: Browser, page: Page, window: Mapping[str, Any]) -> PageCost:
    """Open the page that is in front of somebody in a new window, on a slow machine, with nothing in the cache."""
    cookies = page.context.storage_state()
    context = browser.new_context(storage_state=cookies, **window)
    context.add_init_script(_ADD_UP_SHIFTS)
    copy = context.new_page()
    devtools = context.new_cdp_session(copy)
    devtools.send("Emulation.setCPUThrottlingRate", {"rate": _SLOWDOWN})
    traffic = Traffic(devtools)
    copy.goto(page.url, wait_until="load")
    traffic.wait_until_over(copy)
    here = urlsplit(copy.url)
    cost = PageCost(
        kind=copy.locator("body").get_attribute("data-page") or "",
        address=here.path,
        page_bytes=traffic.num_bytes(pictures=False),
        picture_bytes=traffic.num_bytes(pictures=True),
        foreign=tuple(url for url in traffic.addresses.values() if urlsplit(url).netloc != here.netloc),
        layout_shift=round(copy.evaluate("window.layoutShift"), 3),
    )
    context.close()
    assert here.path == urlsplit(page.url).path
    return cost


@dataclass
class Traffic:
    """What a window asks for, and what comes.

    Attributes:
        devtools: The window's.
        addresses: Of all requests, by their number.
        arrived: The bytes of those that were answered.
        under_way: Those that were not.
    """

    devtools: CDPSession
    addresses: dict[str, str] = field(default_factory=dict)
    arrived: dict[str, int] = field(default_factory=dict)
    under_way: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.devtools.on("Network.requestWillBeSent", self._begin)
        self.devtools.on("Network.loadingFinished", self._finish)
        self.devtools.on("Network.loadingFailed", lambda event: self.under_way.discard(event["requestId"]))
        self.devtools.send("Network.enable")

    def num_bytes(self, *, pictures: bool) -> int:
        """Return the bytes of the study's pictures, or of all the rest."""
        return sum(
            number
            for request, number in self.arrived.items()
            if urlsplit(self.addresses[request]).path.startswith("/pictures/") == pictures
        )

    def wait_until_over(self, page: Page) -> None:
        """Wait until all that was asked for has come, and what it asks for in turn, and has been painted."""
        num_quiet = 0
        for _ in range(MAX_LOOKS):
            page.wait_for_timeout(LOOK_MS)
            num_quiet = 0 if self.under_way else num_quiet + 1
            if num_quiet == NUM_QUIET_LOOKS:
                return
        raise AssertionError(f"still waiting for {[self.addresses[request] for request in self.under_way]}")

    def _begin(self, event: Mapping[str, Any]) -> None:
        self.addresses[event["requestId"]] = event["request"]["url"]
        self.under_way.add(event["requestId"])

    def _finish(self, event: Mapping[str, Any]) -> None:
        self.arrived[event["requestId"]] = event["encodedDataLength"]
        self.under_way.discard(event["requestId"])
