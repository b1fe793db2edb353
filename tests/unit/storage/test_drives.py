"""Drives, action by action."""

from collections.abc import Sequence
from datetime import timedelta

import pytest
from sqlalchemy import select
from sqlalchemy.exc import IntegrityError

from tests.unit.storage.people import (
    DRIVING,
    NOW,
    at_once,
    count,
    drive,
    enrol_somebody,
    page_of_kind,
    pages_of,
    send,
    walk_to,
)
from webapp.storage.answers import drive_actions, store_last_step, store_page, store_step
from webapp.storage.database import Database
from webapp.storage.participants import Participant, find_participant, withdraw
from webapp.storage.tables import drive_steps, drives, pages, trials
from webapp.study.answers import DriveStep, PageContent
from webapp.study.session import NoSuchPageError, Page

WAY = ("pickup", "left", "left")


@pytest.fixture
def participant(database: Database) -> Participant:
    return enrol_somebody(database, study=DRIVING)


@pytest.fixture(params=["practice", "drive"])
def page(database: Database, participant: Participant, request: pytest.FixtureRequest) -> Page:
    """A drive that is due."""
    return walk_to(database, participant, request.param, DRIVING)


def step(number: int, action: str = "forward", elapsed_ms: int | None = None) -> DriveStep:
    return DriveStep(number, action, elapsed_ms)


def take(database: Database, participant: Participant, page: Page, actions: Sequence[str]) -> list[str]:
    return [
        store_step(database, participant, page, step(number, action), NOW)
        for number, action in enumerate(actions, start=1)
    ]


def arrived(page: Page, num_steps: int) -> PageContent:
    return PageContent(drive=drive(page, "reached", num_steps))


def test_actions_are_stored_one_by_one_with_their_times(
    database: Database, participant: Participant, page: Page
) -> None:
    num_drives = count(database, drives)
    assert drive_actions(database, participant, page.number) == ()
    for number, (action, elapsed) in enumerate(zip(WAY, (None, 0, 86_400_000), strict=True), start=1):
        later = NOW + timedelta(seconds=number)
        assert store_step(database, participant, page, step(number, action, elapsed), later) == "accept"
        assert drive_actions(database, participant, page.number) == WAY[:number]
    columns = drive_steps.c.elapsed_ms, drive_steps.c.received_at
    with database.read() as connection:
        rows = [tuple(row) for row in connection.execute(select(*columns).order_by(drive_steps.c.number))]
    assert rows == [
        (None, NOW + timedelta(seconds=1)),
        (0, NOW + timedelta(seconds=2)),
        (86_400_000, NOW + timedelta(seconds=3)),
    ]
    assert count(database, drives) == num_drives


def test_actions_know_their_page_and_trial_before_the_page_is_sent(
    database: Database, participant: Participant, page: Page
) -> None:
    take(database, participant, page, WAY)
    query = select(drive_steps.c.page_kind, trials.c.experiment, trials.c.position).outerjoin(
        trials,
        (trials.c.participant_id == drive_steps.c.participant_id) & (trials.c.number == drive_steps.c.trial_number),
    )
    with database.read() as connection:
        rows = {tuple(row) for row in connection.execute(query.where(drive_steps.c.page_number == page.number))}
    assert rows == {(page.kind, page.trial and page.trial.experiment, page.trial and page.trial.position)}


def test_the_first_action_of_a_number_stands(database: Database, participant: Participant, page: Page) -> None:
    take(database, participant, page, WAY)
    assert store_step(database, participant, page, step(1, "toggle"), NOW) == "already_answered"
    assert store_step(database, participant, page, step(3, "toggle"), NOW) == "already_answered"
    assert store_step(database, participant, page, step(5, "toggle"), NOW) == "too_early"
    assert drive_actions(database, participant, page.number) == WAY


@pytest.mark.parametrize("number", [0, -1])
def test_an_action_before_the_first_is_none(
    database: Database, participant: Participant, page: Page, number: int
) -> None:
    assert store_step(database, participant, page, step(number), NOW) != "accept"
    assert drive_actions(database, participant, page.number) == ()


def test_of_twenty_simultaneous_actions_of_a_number_one_is_stored(
    database: Database, participant: Participant, page: Page
) -> None:
    take(database, participant, page, WAY)
    outcomes = at_once(20, lambda number: store_step(database, participant, page, step(4, f"action {number}"), NOW))
    assert sorted(outcomes) == ["accept"] + ["already_answered"] * 19
    assert drive_actions(database, participant, page.number) == (*WAY, f"action {outcomes.index('accept')}")


def test_of_twenty_simultaneous_last_actions_one_is_stored_with_its_page(
    database: Database, participant: Participant, page: Page
) -> None:
    take(database, participant, page, WAY)

    def arrive(number: int) -> str:
        last = step(4, f"action {number}")
        return store_last_step(database, participant, page, f"nonce {number}", last, arrived(page, 4), NOW)

    outcomes = at_once(20, arrive)
    assert sorted(outcomes) == ["accept"] + ["already_answered"] * 19
    first = outcomes.index("accept")
    assert drive_actions(database, participant, page.number) == (*WAY, f"action {first}")
    with database.read() as connection:
        nonces = connection.execute(select(pages.c.nonce).where(pages.c.number == page.number)).scalars().all()
    assert nonces == [f"nonce {first}"]


def test_the_last_action_and_the_page_are_stored_together_or_not_at_all(
    database: Database, participant: Participant, page: Page
) -> None:
    take(database, participant, page, WAY)
    taken = f"{participant.id} 1"  # The nonce of a page that is stored.
    with pytest.raises(IntegrityError):
        store_last_step(database, participant, page, taken, step(4), arrived(page, 4), NOW)
    assert drive_actions(database, participant, page.number) == WAY
    num_drives = count(database, drives)
    assert store_last_step(database, participant, page, "fresh", step(4), arrived(page, 4), NOW) == "accept"
    assert drive_actions(database, participant, page.number) == (*WAY, "forward")
    assert count(database, drives) == num_drives + 1
    found = find_participant(database, participant.token_hash)
    assert found is not None
    assert found.num_stored == page.number


def test_a_drive_is_stored_as_it_went(database: Database, participant: Participant) -> None:
    page = walk_to(database, participant, "drive", DRIVING)
    take(database, participant, page, WAY)
    result = drive(page, "step_limit", 3, key_points=(1, 5, 7))
    gave_up = PageContent(drive=result)
    assert store_page(database, participant, page, "n", gave_up, NOW) == "accept"
    with database.read() as connection:
        row = connection.execute(select(drives).where(drives.c.page_number == page.number)).one()
    assert (row.phase, row.end, row.num_steps, row.optimum, row.step_limit) == ("after", "step_limit", 3, 7, 21)
    assert (row.layout, row.subgoals_passed, row.key_points) == (result.layout, "", "1 5 7")


def test_nothing_is_stored_after_the_end_of_a_drive(database: Database, participant: Participant, page: Page) -> None:
    take(database, participant, page, WAY)
    store_last_step(database, participant, page, "n", step(4), arrived(page, 4), NOW)
    for number in (4, 5):
        assert store_step(database, participant, page, step(number), NOW) == "already_answered"
        outcome = store_last_step(database, participant, page, "m", step(number), arrived(page, number), NOW)
        assert outcome == "already_answered"
    gave_up = PageContent(drive=drive(page, num_steps=4))
    assert store_page(database, participant, page, "m", gave_up, NOW) == "already_answered"
    assert drive_actions(database, participant, page.number) == (*WAY, "forward")


def test_whoever_gives_up_while_an_action_comes_in_is_not_taken_at_an_old_word(
    database: Database, participant: Participant, page: Page
) -> None:
    take(database, participant, page, WAY)
    for num_steps in (2, 4):
        stale = PageContent(drive=drive(page, num_steps=num_steps))
        assert store_page(database, participant, page, "n", stale, NOW) == "already_answered"
    assert store_page(database, participant, page, "n", PageContent(drive=drive(page, num_steps=3)), NOW) == "accept"


def test_a_drive_that_is_not_due_takes_no_actions(database: Database, participant: Participant) -> None:
    page = page_of_kind(database, participant, "drive", DRIVING)
    assert store_step(database, participant, page, step(1), NOW) == "too_early"
    assert store_last_step(database, participant, page, "n", step(1), arrived(page, 1), NOW) == "too_early"
    assert count(database, drive_steps) == 0
    with pytest.raises(NoSuchPageError):
        store_step(database, participant, Page(99, "practice", None), step(1), NOW)


def test_whoever_left_drives_no_more(database: Database, participant: Participant, page: Page) -> None:
    take(database, participant, page, WAY)
    withdraw(database, participant, NOW)
    assert store_step(database, participant, page, step(4), NOW) == "ended"
    assert store_last_step(database, participant, page, "n", step(4), arrived(page, 4), NOW) == "ended"
    assert drive_actions(database, participant, page.number) == WAY


def test_the_last_action_of_a_drive_needs_its_result(database: Database, participant: Participant, page: Page) -> None:
    with pytest.raises(ValueError, match="a drive's result"):
        store_last_step(database, participant, page, "n", step(1), PageContent(), NOW)
    assert count(database, drive_steps) == 0


def test_a_drive_that_is_the_last_page_completes(database: Database, participant: Participant) -> None:
    for number in range(1, participant.num_pages):
        send(database, participant, number, study=DRIVING)
    page = pages_of(database, participant, DRIVING)[-1]
    assert page.kind == "drive"
    store_last_step(database, participant, page, "n", step(1), arrived(page, 1), NOW)
    found = find_participant(database, participant.token_hash)
    assert found is not None
    assert found.completed_at == NOW
