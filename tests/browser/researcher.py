"""The researcher at the browser."""

from pathlib import Path

from playwright.sync_api import Page

from tests.browser.site import RESEARCHER, Row, Site, read_csv


def sign_in(page: Page, site: Site) -> None:
    """Sign in and wait for the overview."""
    page.goto("/researcher/")
    page.get_by_label("Name").fill(RESEARCHER)
    page.get_by_label("Password").fill(site.password)
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("heading", name="Overview").wait_for()


def unblind(page: Page, site: Site, reason: str = "The study is over") -> None:
    """See the arms from now on; nothing changes for whoever sees them already."""
    page.goto("/researcher/unblind")
    if page.get_by_label("Reason").is_visible():
        page.get_by_label("Reason").fill(reason)
        page.get_by_label("Your password").fill(site.password)
        page.get_by_role("button", name="Unblind me").click()
        page.get_by_role("heading", name="Results").wait_for()


def download(page: Page, name: str, folder: Path) -> list[Row]:
    """Download a file of the data from its page and return its rows; whoever asks must have unblinded themselves."""
    page.goto("/researcher/data")
    with page.expect_download() as started:
        page.get_by_role("link", name=f"{name} as stored").click()
    assert started.value.suggested_filename == name
    started.value.save_as(folder / name)
    return read_csv((folder / name).read_bytes())
