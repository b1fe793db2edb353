"""Every kind of page of both shipped studies is light, asks nobody else, and holds still while it is loaded."""

import random
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from playwright.sync_api import Browser

from tests.browser.arrivals import agree_until
from tests.browser.page_costs import PageCost, weigh
from tests.browser.site import Site, serve
from tests.browser.walker import DRIVES, GIVE_UP, Walker
from tests.browser.windows import DESKTOP, PHONE, TIMEOUT_MS
from tests.conftest import ROOT
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build

MAX_PAGE_BYTES = 60_000
MAX_PICTURE_BYTES_PER_TRIAL = 150_000
KINDS = {
    "understanding": {
        "background",
        "instructions",
        "practice",
        "quiz",
        "situation",
        "first_drive",
        "rating",
        "probe",
        "drive",
    },
    "sakai2021": {"instructions", "situation", "rating"},
}
NUM_TRIALS = {"understanding": 3, "sakai2021": 5}
OF_A_TRIAL = frozenset({"situation", "rating"})


@dataclass(frozen=True, slots=True)
class Bill:
    """What the pages of one participant cost.

    Attributes:
        study: Of which study.
        pages: On a phone: the situations and explanations of all trials, and one page of every other kind.
        wide_pages: One page of each kind on a large screen.
    """

    study: str
    pages: list[PageCost] = field(default_factory=list)
    wide_pages: list[PageCost] = field(default_factory=list)

    def add(self, browser: Browser, walker: Walker) -> None:
        """Weigh the page in front of a participant, if one like it was not weighed before."""
        kind = walker.kind()
        is_new = kind not in {cost.kind for cost in self.pages} or walker.page.locator("[data-player]").count() > 0
        if is_new or kind in OF_A_TRIAL:
            self.pages.append(weigh(browser, walker.page, PHONE))
        if is_new:
            self.wide_pages.append(weigh(browser, walker.page, DESKTOP))


@pytest.fixture(scope="module", params=sorted(KINDS))
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp(request.param)
    build(ROOT / "webapp/studies" / request.param, folder / "built", progress=lambda *_: None, agents=planner_agents)
    (folder / "instance").mkdir()
    with serve(folder / "built", folder / "instance", request.param) as site:
        yield site


@pytest.fixture(scope="module")
def bill(browser: Browser, site: Site) -> Bill:
    bill = Bill(site.catalogue.study.name)
    context = browser.new_context(base_url=site.address, reduced_motion="reduce", **PHONE)
    context.set_default_timeout(TIMEOUT_MS)
    walker = Walker(context.new_page(), site.catalogue, "", random.Random(3))
    for path in ("/declined", "/"):
        walker.page.goto(path)
        bill.pages.append(weigh(browser, walker.page, PHONE))
    agree_until(walker, site, lambda kinds: bill.study != "understanding" or "tailored_all" in kinds)
    while "/study/" in walker.page.url:
        bill.add(browser, walker)
        if walker.kind() in DRIVES:
            walker.drive("left", GIVE_UP)
        else:
            walker.answer_page()
    assert walker.page.url.endswith("/done")
    bill.pages.append(weigh(browser, walker.page, PHONE))
    context.close()
    return bill


def test_every_kind_of_page_was_weighed(bill: Bill) -> None:
    for costs in (bill.pages, bill.wide_pages):
        assert {cost.kind for cost in costs} >= KINDS[bill.study]
        assert min(cost.page_bytes for cost in costs) > 1000


def test_no_page_is_heavy(bill: Bill) -> None:
    assert [cost for cost in bill.pages + bill.wide_pages if cost.page_bytes > MAX_PAGE_BYTES] == []


def test_no_trial_has_heavy_pictures(bill: Bill) -> None:
    costs = [cost for cost in bill.pages if cost.kind in OF_A_TRIAL]
    trials = list(zip(costs[::2], costs[1::2], strict=True))
    assert [(one.kind, other.kind) for one, other in trials] == [("situation", "rating")] * NUM_TRIALS[bill.study]
    weights = [one.picture_bytes + other.picture_bytes for one, other in trials]
    assert 0 < min(weights) <= max(weights) <= MAX_PICTURE_BYTES_PER_TRIAL


def test_no_page_asks_another_host(bill: Bill) -> None:
    assert [address for cost in bill.pages + bill.wide_pages for address in cost.foreign] == []


def test_no_page_moves_while_it_is_loaded(bill: Bill) -> None:
    assert [cost for cost in bill.pages + bill.wide_pages if cost.layout_shift] == []
