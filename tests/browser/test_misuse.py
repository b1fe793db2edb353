"""Impatient hands and lost ways: whatever a person does, each answer is stored once, and the first one stands."""

import random
import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.participant import Participant
from tests.browser.site import Row, Site
from tests.browser.windows import DESKTOP, TIMEOUT_MS, OpenContext

Arrive = Callable[..., Participant]


@pytest.fixture(params=[True, False], ids=["with scripts", "without scripts"])
def arrive(request: pytest.FixtureRequest, site: Site, open_context: OpenContext) -> Iterator[Arrive]:
    """Bring a participant to the first rating page."""
    pages: list[Page] = []

    def arrive() -> Participant:
        page = open_context(java_script_enabled=request.param, **DESKTOP).new_page()
        pages.append(page)
        participant = Participant(page, site, random.Random(1))
        participant.agree()
        participant.go_on("instructions.start")
        participant.go_on("situation.continue")
        return participant

    yield arrive
    for page in pages:
        page.close()


def newest_ratings(site: Site) -> dict[str, str]:
    """Return the ratings of whoever came last, by item; fail if there are two of one item."""
    last = max(site.export("participants.csv"), key=lambda row: row["consented_at"])
    rows: list[Row] = [row for row in site.export("ratings.csv") if row["participant"] == last["participant"]]
    assert len({(row["experiment"], row["trial"], row["item"]) for row in rows}) == len(rows)
    return {row["item"]: row["rating"] for row in rows if (row["experiment"], row["trial"]) == ("1", "1")}


def all_rated(participant: Participant, rating: int) -> dict[str, str]:
    items = participant.site.catalogue.study.experiments[0].items
    return {item.id: str(rating) for item in items}


def test_a_double_click_sends_once(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    participant.answer_all(4)
    participant.button("explanation.send").dblclick()
    expect(participant.page).to_have_url(re.compile("/study/4$"), timeout=TIMEOUT_MS)
    assert newest_ratings(site) == all_rated(participant, 4)


def test_a_double_click_on_the_consent_makes_one_participant(site: Site, open_context: OpenContext) -> None:
    for scripts in (True, False):
        before = len(site.export("participants.csv"))
        page = open_context(java_script_enabled=scripts, **DESKTOP).new_page()
        page.goto("/")
        page.get_by_role("checkbox").check()
        page.get_by_role("button", name=site.texts("welcome.start")).dblclick()
        expect(page).to_have_url(re.compile("/study/1$"), timeout=TIMEOUT_MS)
        page.wait_for_load_state()
        page.close()
        assert len(site.export("participants.csv")) == before + 1


def test_going_back_and_answering_anew_changes_nothing_and_says_so(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    participant.answer_all(2)
    participant.send()
    participant.page.go_back()
    if participant.page.url.endswith("/study/3"):
        assert_first_answer_stands(participant, site, first=2)
    else:
        expect(participant.page).to_have_url(re.compile("/study/4$"), timeout=TIMEOUT_MS)
    assert newest_ratings(site) == all_rated(participant, 2)


def test_a_reload_after_sending_sends_nothing_again(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    participant.answer_all(3)
    participant.send()
    participant.page.reload()
    assert participant.page.url.endswith("/study/4")
    assert newest_ratings(site) == all_rated(participant, 3)


def test_of_two_tabs_the_first_to_send_stands_and_the_second_is_told(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    page = participant.page.context.new_page()
    other = Participant(page, site, random.Random(2))
    page.goto("/study/3")
    other.answer_all(1)
    participant.answer_all(5)
    participant.send()
    other.send()
    expect(page.get_by_text(site.texts("notices.already_answered"))).to_be_visible()
    assert page.url.endswith("/study/4")
    assert newest_ratings(site) == all_rated(participant, 5)
    page.close()


def test_enter_held_down_sends_once(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    participant.answer_all(4)
    participant.button("explanation.send").focus()
    for _ in range(6):
        participant.page.keyboard.down("Enter")
    participant.page.keyboard.up("Enter")
    expect(participant.page).to_have_url(re.compile("/study/4$"), timeout=TIMEOUT_MS)
    assert newest_ratings(site) == all_rated(participant, 4)


def test_a_page_that_is_not_due_leads_back_to_the_one_that_is(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    participant.page.goto("/study/7")
    assert participant.page.url.endswith("/study/3")
    expect(participant.page.get_by_text(site.texts("notices.too_early"))).to_be_visible()


def test_a_missing_answer_is_pointed_out_and_the_others_are_kept(site: Site, open_context: OpenContext) -> None:
    for scripts in (True, False):
        page = open_context(expected=("422",), java_script_enabled=scripts, **DESKTOP).new_page()
        participant = Participant(page, site, random.Random(3))
        participant.agree()
        participant.go_on("instructions.start")
        participant.go_on("situation.continue")
        first, missing, last = participant.items()
        participant.answer(first, 2)
        participant.answer(last, 5)
        participant.button("explanation.send").click()
        summary = page.locator(".error-summary a")
        expect(summary).to_have_count(1)
        assert page.locator(f"#rating-{first}-2").is_checked()
        assert page.locator(f"#rating-{last}-5").is_checked()
        assert newest_ratings(site) == {}
        summary.click()
        expect(page.locator(f"#rating-{missing}-1")).to_be_focused()
        participant.answer(missing, 1)
        participant.send()
        assert newest_ratings(site) == {first: "2", missing: "1", last: "5"}
        page.close()


def test_somebody_who_leaves_keeps_the_answers_given_and_can_give_no_more(arrive: Arrive, site: Site) -> None:
    participant = arrive()
    participant.answer_all(3)
    participant.send()
    participant.page.get_by_role("link", name=site.texts("page.leave")).click()
    participant.go_on("leave.confirm")
    expect(participant.page).to_have_url(re.compile("/left$"), timeout=TIMEOUT_MS)
    participant.page.goto("/study/4")
    assert participant.page.url.endswith("/left")
    assert newest_ratings(site) == all_rated(participant, 3)
    assert max(site.export("participants.csv"), key=lambda row: row["consented_at"])["withdrawn_at"]


def assert_first_answer_stands(participant: Participant, site: Site, first: int) -> None:
    """Answer differently on the page that the browser brought back."""
    participant.answer_all(6 - first)
    participant.send()
    expect(participant.page.get_by_text(site.texts("notices.already_answered"))).to_be_visible()
