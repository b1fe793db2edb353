"""What browsers keep: styles, scripts and pictures are asked for once, and anew where they have changed."""

import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import pytest
from flask import Flask
from playwright.sync_api import Page

from tests.browser.site import Site, serve
from tests.browser.windows import DESKTOP, OpenContext
from tests.conftest import ROOT
from tests.web.bundles import read_study, write_bundle
from webapp.views.assets import init_assets

ASKED = """() => performance.getEntriesByType("resource").filter((one) => one.name.includes("/static/"))
    .map((one) => [new URL(one.name).pathname, one.transferSize])"""
OLD = {"If-None-Match": '"x", *', "If-Modified-Since": "Sat, 29 Oct 2033 19:43:31 GMT"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("kept")
    write_bundle(folder / "built", read_study())
    (folder / "instance").mkdir()
    with serve(folder / "built", folder / "instance") as site:
        yield site


@pytest.fixture
def page(open_context: OpenContext) -> Page:
    return open_context(**DESKTOP).new_page()


def asked(page: Page, path: str) -> dict[str, int]:
    """Visit a page; return the bytes that came of each style and script, 0 for those that were kept."""
    page.goto(path)
    page.wait_for_load_state("networkidle")
    return _came(page)


def test_styles_and_scripts_are_asked_for_once_by_page_and_by_reload(page: Page) -> None:
    first = asked(page, "/")
    assert len(first) >= 3
    assert all(first.values())
    again = asked(page, "/declined")
    assert set(again) & set(first)
    assert [name for name in set(again) & set(first) if again[name]] == []
    page.reload()
    page.wait_for_load_state("networkidle")
    assert not any(_came(page).values())
    # The control: whoever comes for the first time is sent all of it.
    page.context.clear_cookies()
    page.context.new_cdp_session(page).send("Network.clearBrowserCache")
    assert all(asked(page, "/").values())


def test_a_changed_file_has_another_address_and_the_old_one_leads_nowhere(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "static", tmp_path / "static")
    before = _app(tmp_path / "static")
    (tmp_path / "static/css/base.css").write_text("body { color: red }", encoding="utf-8")
    after = _app(tmp_path / "static")
    (old,), (new,) = ({_address(app)("css/base.css")} for app in (before, after))
    assert old != new
    assert after.test_client().get(old).status_code == 404
    assert after.test_client().get(new).text == "body { color: red }"
    assert _address(before)("js/participant.js") != _address(after)("js/participant.js")


def test_nobody_needs_to_ask_whether_a_file_has_changed(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "static", tmp_path / "static")
    app = _app(tmp_path / "static")
    for path in sorted(path for path in (tmp_path / "static").rglob("*") if path.is_file()):
        address = _address(app)(path.relative_to(tmp_path / "static").as_posix())
        answer = app.test_client().get(address, headers=OLD)
        assert (answer.status_code, answer.data) == (200, path.read_bytes())
        assert answer.headers["Cache-Control"] == "public, max-age=31536000, immutable"
        assert {"ETag", "Last-Modified", "Expires", "Set-Cookie"} & set(answer.headers.keys()) == set()


def _came(page: Page) -> dict[str, int]:
    found: Counter[str] = Counter()
    for name, size in page.evaluate(ASKED):
        found[name] += size  # What is loaded ahead is there twice, the second time without a byte.
    return dict(found)


def _app(folder: Path) -> Flask:
    app = Flask("assets", static_folder=None)
    init_assets(app, folder)
    return app


def _address(app: Flask) -> Callable[[str], str]:
    return cast("Callable[[str], str]", app.jinja_env.globals["asset"])
