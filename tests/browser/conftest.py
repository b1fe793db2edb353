"""Chromium, watched: what a page complains about fails the test that visited it."""

import os
import runpy
from collections.abc import Generator, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Page, sync_playwright

from tests.browser.hostile_windows import REFUSED, listen
from tests.browser.site import Site, serve
from tests.browser.windows import DESKTOP, OPENED, TIMEOUT_MS, OpenContext, watch
from tests.conftest import ROOT

OPTIONS = ("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One Chromium per worker."""
    path = runpy.run_path(str(ROOT / ".ci/install.py"))["find_browser"]()
    assert path is not None, "no Chromium was found; `make test` installs one or says how"
    sandbox = ("--no-sandbox",) if os.geteuid() == 0 else ()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*OPTIONS, *sandbox])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def site(planned_instance: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A server of the module's own, with nobody in its database but the researcher."""
    with serve(planned_instance, tmp_path_factory.mktemp("instance")) as site:
        yield site


@pytest.fixture(scope="module")
def open_context(browser: Browser, site: Site, request: pytest.FixtureRequest) -> Iterator[OpenContext]:
    """Open browser windows that know nothing of each other, and in the end nothing may have complained."""
    opened: list[BrowserContext] = []
    complaints: list[str] = []
    request.node.stash[OPENED] = opened

    def open_context(*, expected: tuple[str, ...] = (), **options: Any) -> BrowserContext:  # noqa: ANN401
        context = browser.new_context(base_url=site.address, **{"reduced_motion": "reduce", **options})
        context.set_default_timeout(TIMEOUT_MS)
        watch(context, complaints, expected)
        opened.append(context)
        return context

    yield open_context
    for context in opened:
        context.close()
    assert complaints == []


@pytest.fixture
def page(open_context: OpenContext) -> Iterator[Page]:
    """A window for hostile texts, in which nothing may run or open; most modules have a page of their own instead."""
    page = open_context(expected=REFUSED, **DESKTOP).new_page()
    dialogs = listen(page.context)
    yield page
    assert dialogs == []
    page.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep a picture of every open page when a test fails, in test-results/."""
    report = yield
    module = item.getparent(pytest.Module)
    if report.failed and module is not None:
        folder = ROOT / "test-results"
        folder.mkdir(exist_ok=True)
        pages = [page for context in module.stash.get(OPENED, []) for page in context.pages]
        for number, page in enumerate(pages):
            name = f"{module.name.removesuffix('.py')}-{item.name}-{number}.png"
            # A page that hangs is a reason for the failure, not for another one.
            with suppress(Error):
                page.screenshot(path=folder / name, full_page=True, timeout=5_000)
    return report
