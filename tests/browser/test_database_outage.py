"""PostgreSQL is gone while somebody answers: what they chose stays on the page, and is stored once when it is back."""

import random
import shutil
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests import postgres
from tests.browser.participant import Participant
from tests.browser.site import STUDY, Site
from tests.browser.windows import DESKTOP, OpenContext
from tests.faults.program import running
from webapp.stimuli.catalogue import Catalogue, current_bundle

PROVOKED = ("503", "Failed to load resource")


@pytest.fixture(scope="module")
def name(postgres_server: postgres.Server) -> Iterator[str]:
    made = postgres_server.make()
    yield made
    postgres_server.drop(made)


@pytest.fixture(scope="module")
def site(
    planned_instance: Path, tmp_path_factory: pytest.TempPathFactory, postgres_server: postgres.Server, name: str
) -> Iterator[Site]:
    """A server with two workers."""
    instance = tmp_path_factory.mktemp("outage") / "instance"
    shutil.copytree(planned_instance / "bundles", instance / "bundles")
    catalogue = Catalogue.open(current_bundle(instance, STUDY))
    settings = {"DATABASE_URL": postgres_server.url(name), "WEB_CONCURRENCY": "2", "XAR_STUDY": STUDY}
    with running(instance, **settings) as program:
        yield Site(f"http://127.0.0.1:{program.port}", instance, "", catalogue)


def rows(server: postgres.Server, name: str) -> list[tuple[str, int]]:
    with closing(server.connect(name)) as connection:
        return connection.execute("SELECT item, rating FROM ratings ORDER BY item, rating").fetchall()


def at_the_first_ratings(open_context: OpenContext, site: Site, *, scripts: bool) -> Participant:
    window = open_context(expected=PROVOKED, java_script_enabled=scripts, **DESKTOP)
    participant = Participant(window.new_page(), site, random.Random(1))
    participant.agree()
    participant.go_on("instructions.start")
    participant.go_on("situation.continue")
    return participant


def assert_chosen(participant: Participant, items: list[str], rating: int) -> None:
    for item in items:
        expect(participant.page.locator(f"#rating-{item}-{rating}")).to_be_checked()


def test_what_was_chosen_stays_and_is_sent_by_itself_when_the_database_is_back(
    open_context: OpenContext, site: Site, postgres_server: postgres.Server, name: str
) -> None:
    participant = at_the_first_ratings(open_context, site, scripts=True)
    items = participant.items()
    participant.answer_all(4)
    with postgres_server.gone():
        participant.button("explanation.send").click(no_wait_after=True)
        expect(participant.page.locator(".sending-notice")).not_to_be_empty()
        assert participant.page.url.endswith("/study/3")
        assert_chosen(participant, items, 4)
    participant.page.wait_for_url("**/study/4", timeout=30_000)
    assert rows(postgres_server, name) == sorted((item, 4) for item in items)


def test_without_scripts_a_page_says_so_and_the_way_back_leads_to_what_was_chosen(
    open_context: OpenContext, site: Site, postgres_server: postgres.Server, name: str
) -> None:
    before = rows(postgres_server, name)
    participant = at_the_first_ratings(open_context, site, scripts=False)
    page, items = participant.page, participant.items()
    participant.answer_all(2)
    with postgres_server.gone():
        with page.expect_response("**/study/3") as answered:
            participant.button("explanation.send").click()
        assert answered.value.status == 503
        assert answered.value.headers["retry-after"] == "5"
        expect(page.get_by_text(site.texts("error_pages.busy"))).to_be_visible()
    page.go_back()
    assert_chosen(participant, items, 2)
    participant.button("explanation.send").click()
    page.wait_for_url("**/study/4")
    assert rows(postgres_server, name) == sorted([*before, *((item, 2) for item in items)])
