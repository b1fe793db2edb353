"""What researchers decide about a participant, and how they help one who is stuck."""

from collections.abc import Mapping
from datetime import timedelta

import pytest
from sqlalchemy import select

from tests.unit.storage.people import DRIVING, NOW, STUDY, count, enrol_somebody, page_of_kind, pages_of, send, walk
from tests.unit.storage.people import walk_to as go_to
from webapp.storage.answers import drive_actions, last_answers, num_attempts, store_page, store_step
from webapp.storage.database import Database
from webapp.storage.erasure import erase
from webapp.storage.helping import make_link, release_page, restart_page
from webapp.storage.participants import Participant, find_participant, hash_token, withdraw
from webapp.storage.people import (
    MAX_REASON_LENGTH,
    Correction,
    PersonError,
    correct,
    exclude,
    exclusion_states,
    find_person,
    include,
    note,
)
from webapp.storage.records import told_by
from webapp.storage.scope import Scope
from webapp.storage.tables import drive_steps, ratings
from webapp.storage.timeline import timeline
from webapp.storage.unblinding import (
    arm_labels,
    has_looked,
    is_person_unblinded,
    unblind,
    unblind_person,
    unblinded_at,
)
from webapp.storage.verification import verify_log
from webapp.study.answers import Answer, DriveStep, PageContent
from webapp.study.corrections import Asked
from webapp.study.protocol import Study

SCOPE = Scope(STUDY.name, "v1", "test")


def anew(database: Database, participant: Participant) -> Participant:
    found = find_participant(database, participant.token_hash)
    assert found is not None
    return found


def excluded(database: Database) -> dict[int, str]:
    with database.read() as connection:
        return {person: exclusion.reason for person, exclusion in exclusion_states(connection, SCOPE).items()}


def test_an_exclusion_and_taking_it_back_are_both_on_record(database: Database) -> None:
    person, other = enrol_somebody(database), enrol_somebody(database)
    exclude(database, person.code, " was in the pilot ", "boss", NOW)
    assert excluded(database) == {person.id: "was in the pilot"}
    with pytest.raises(PersonError, match="excluded already"):
        exclude(database, person.code, "again", "boss", NOW)
    include(database, person.code, "that was somebody else", "boss", NOW)
    assert excluded(database) == {}
    with pytest.raises(PersonError, match="is not excluded"):
        include(database, other.code, "never was", "boss", NOW)
    with database.read() as connection:
        assert [row[3] for row in told_by(connection, "excluded", "included")] == ["excluded", "included"]


@pytest.mark.parametrize(("text", "wish"), [("  ", "is missing"), ("x" * (MAX_REASON_LENGTH + 1), "has 501 char")])
def test_a_reason_is_needed_and_has_an_end(database: Database, text: str, wish: str) -> None:
    person = enrol_somebody(database)
    with pytest.raises(PersonError, match=f"the reason {wish}"):
        exclude(database, person.code, text, "boss", NOW)
    with pytest.raises(PersonError, match=f"the note {wish}"):
        note(database, person.code, text, "boss", NOW)
    assert excluded(database) == {}


def test_somebody_who_is_not_there_is_named(database: Database) -> None:
    with pytest.raises(PersonError, match="there is no participant 'abc'"):
        find_person(database, "abc")
    with pytest.raises(PersonError, match="there is no participant 'abc'"):
        erase(database, "abc", "boss", NOW)


def test_a_correction_stands_beside_the_answer_which_stays(database: Database) -> None:
    person = enrol_somebody(database)
    walk(database, person, 11, rating=3)
    asked = Asked(STUDY, page_of_kind(database, person, "rating"), ("left", "right"))
    correct(database, person.code, Correction("ratings", asked, "general", "4"), "told us on the phone", "boss", NOW)
    with database.read() as connection:
        (told,) = told_by(connection, "corrected")
        assert set(connection.execute(select(ratings.c.rating)).scalars()) == {3}
    assert (told[-1]["from"], told[-1]["to"], told[-1]["question"]) == ("3", "4", "general")
    for file, question, wish in (
        ("ratings", "nothing", "no answer to 'nothing'"),
        ("answers", "general", "no answer to 'general'"),
        ("probes", "1", "no answer to '1'"),
        ("probes", "9" * 30, "no answer to '9"),
        ("drives", "1", "cannot be corrected; use answers, ratings, probes"),
    ):
        with pytest.raises(PersonError, match=wish):
            correct(database, person.code, Correction(file, asked, question, "4"), "why", "boss", NOW)


def test_only_what_could_have_been_answered_can_be_a_correction(database: Database) -> None:
    person = enrol_somebody(database, study=DRIVING)
    walk(database, person, person.num_pages, study=DRIVING)
    for kind, file, question, value in (
        ("rating", "ratings", "foresee", "6"),
        ("rating", "ratings", "foresee", "banana"),
        ("probe", "probes", "1", "up"),
    ):
        asked = Asked(DRIVING, page_of_kind(database, person, kind, DRIVING), ("left", "right"))
        with pytest.raises(PersonError, match=f"'{value}' cannot be answered there; use "):
            correct(database, person.code, Correction(file, asked, question, value), "why", "boss", NOW)
    correct(database, person.code, Correction("probes", asked, "1", "right"), "why", "boss", NOW)
    with database.read() as connection:
        assert [told[-1]["to"] for told in told_by(connection, "corrected")] == ["right"]


def test_a_released_page_is_stored_with_nothing_on_it_and_the_participant_goes_on(database: Database) -> None:
    person = enrol_somebody(database)
    walk(database, person, 2)
    number = page_of_kind(database, person, "rating").number
    page = pages_of(database, person)[number - 1]
    release_page(database, person.code, page, "the pictures do not load", "boss", NOW)
    assert anew(database, person).num_stored == 3
    assert count(database, ratings) == 0
    assert send(database, person, number) == "already_answered"
    assert send(database, person, number + 1) == "accept"
    with pytest.raises(PersonError, match=f"is at page {number + 2}, not at page {number}"):
        release_page(database, person.code, page, "again", "boss", NOW)
    assert verify_log(database).problems == ()


def test_releasing_the_last_page_completes_the_study(database: Database) -> None:
    person = enrol_somebody(database)
    walk(database, person, 10)
    release_page(database, person.code, pages_of(database, person)[10], "the bus came", "boss", NOW)
    assert anew(database, person).completed_at == NOW
    assert verify_log(database).problems == ()


def test_a_drive_begun_anew_starts_at_its_beginning_and_keeps_what_was_done(database: Database) -> None:
    person = enrol_somebody(database, study=DRIVING)
    page = go_to(database, person, "drive", DRIVING)
    for number in (1, 2, 3):
        assert store_step(database, person, page, DriveStep(number, "left", None), NOW) == "accept"
    restart_page(database, person.code, page.number, "the screen was black", "boss", NOW)
    assert drive_actions(database, person, page.number) == ()
    assert store_step(database, person, page, DriveStep(4, "left", None), NOW) == "too_early"
    assert store_step(database, person, page, DriveStep(1, "forward", None), NOW) == "accept"
    restart_page(database, person.code, page.number, "and again", "boss", NOW)
    assert store_step(database, person, page, DriveStep(1, "right", None), NOW) == "accept"
    assert drive_actions(database, person, page.number) == ("right",)
    with database.read() as connection:
        rows = connection.execute(select(drive_steps.c.number, drive_steps.c.action).order_by(drive_steps.c.number))
        assert [tuple(row) for row in rows] == [
            (1, "left"),
            (2, "left"),
            (3, "left"),
            (4, "forward"),
            (5, "right"),
        ]
    assert verify_log(database).problems == ()


def test_a_quiz_begun_anew_has_all_its_attempts(database: Database) -> None:
    person = enrol_somebody(database, study=DRIVING)
    page = go_to(database, person, "quiz", DRIVING)

    def attempt(number: int, *, is_final: bool = False) -> str:
        answers = (Answer("goal", f"answer {number}", is_correct=False),)
        content = PageContent(answers=answers, attempt=number, is_final=is_final)
        return store_page(database, person, page, f"nonce {number}", content, NOW)

    assert attempt(1) == "accept"
    restart_page(database, person.code, page.number, "did not know the language", "boss", NOW)
    assert num_attempts(database, person, page.number) == 0
    assert last_answers(database, person, page.number) == {}
    assert attempt(2) == "already_answered"
    assert attempt(1) == "accept"
    assert num_attempts(database, person, page.number) == 1
    assert last_answers(database, person, page.number)["goal"].answer == "answer 1"
    assert attempt(2, is_final=True) == "accept"
    assert verify_log(database).problems == ()


def test_help_is_for_those_who_are_still_there(database: Database) -> None:
    person = enrol_somebody(database)
    withdraw(database, person, NOW)
    page = pages_of(database, person)[0]
    for helped in (
        lambda: release_page(database, person.code, page, "why", "boss", NOW),
        lambda: restart_page(database, person.code, 1, "why", "boss", NOW),
        lambda: make_link(database, person.code, "why", "boss", NOW),
    ):
        with pytest.raises(PersonError, match="the study is over"):
            helped()


def test_a_nul_is_stored_nowhere_and_names_nobody(database: Database) -> None:
    person = enrol_somebody(database)
    note(database, person.code, "a\0b", "boss", NOW)
    exclude(database, person.code, "\0why", "boss", NOW)
    assert [entry.detail for entry in timeline(database, person.code)[-2:]] == [{"text": "ab"}, {"reason": "why"}]
    with pytest.raises(PersonError, match="the note is missing"):
        note(database, person.code, "\0", "boss", NOW)
    walk(database, person, 11, rating=3)
    asked = Asked(STUDY, page_of_kind(database, person, "rating"), ("left", "right"))
    with pytest.raises(PersonError, match="has no answer to"):
        correct(database, person.code, Correction("ratings", asked, "general\0", "4"), "why", "boss", NOW)
    correct(database, person.code, Correction("ratings", asked, "general", "\x004"), "why", "boss", NOW)
    assert verify_log(database).problems == ()


def test_a_new_link_leads_to_the_same_person_and_the_old_one_stays_good(database: Database) -> None:
    person = enrol_somebody(database)
    with pytest.raises(PersonError, match="the reason is missing"):
        make_link(database, person.code, " ", "boss", NOW)
    token = make_link(database, person.code, "They lost it", "boss", NOW)
    assert timeline(database, person.code)[-1].detail == {"reason": "They lost it"}
    assert find_participant(database, hash_token(token)) == person
    assert find_participant(database, person.token_hash) == person
    erase(database, person.code, "boss", NOW)
    assert find_participant(database, hash_token(token)) is None


def test_a_timeline_tells_everything_in_order(database: Database) -> None:
    person, other = enrol_somebody(database), enrol_somebody(database)
    walk(database, person, 2)
    walk(database, other, 1)
    note(database, person.code, "asked for a pause", "boss", NOW + timedelta(minutes=1))
    withdraw(database, anew(database, person), NOW + timedelta(minutes=2))
    told = timeline(database, person.code)
    assert [(entry.action, entry.page, entry.page_kind) for entry in told] == [
        ("allocated", None, None),
        ("consented", None, None),
        ("sent", 1, "instructions"),
        ("sent", 2, "situation"),
        ("noted", None, None),
        ("withdrew", None, None),
    ]
    assert told[4].detail == {"text": "asked for a pause"}
    with pytest.raises(PersonError):
        timeline(database, "nobody")


def test_unblinding_is_per_account_and_data_and_is_recorded(database: Database) -> None:
    live = Scope(STUDY.name, "v1", "live")
    unblind(database, "boss", SCOPE, "the analysis begins", NOW)
    assert unblinded_at(database, "boss", SCOPE) == NOW
    assert unblinded_at(database, "assistant", SCOPE) is None
    assert unblinded_at(database, "boss", live) is None
    with pytest.raises(PersonError, match="the reason is missing"):
        unblind(database, "assistant", SCOPE, " ", NOW)
    person, other = enrol_somebody(database), enrol_somebody(database)
    unblind_person(database, "assistant", person, "is stuck", NOW)
    assert is_person_unblinded(database, "assistant", person)
    assert not is_person_unblinded(database, "assistant", other)
    assert not is_person_unblinded(database, "boss", person)


def test_whoever_looked_at_somebody_has_looked_even_after_that_person_was_erased(database: Database) -> None:
    person = enrol_somebody(database)
    assert not has_looked(database, "boss", SCOPE)
    unblind_person(database, "boss", person, "is stuck", NOW)
    assert has_looked(database, "boss", SCOPE)
    assert not has_looked(database, "assistant", SCOPE)
    assert not has_looked(database, "boss", Scope(STUDY.name, "v1", "live"))
    erase(database, person.code, "boss", NOW)
    assert has_looked(database, "boss", SCOPE)


def masks_of(study: Study) -> list[Mapping[tuple[str, str], str]]:
    """The masks of many instances."""
    return [arm_labels(bytes([byte]) * 32, SCOPE, study) for byte in range(64)]


def test_masks_are_letters_of_each_experiment_that_the_secret_alone_gives() -> None:
    masks = masks_of(STUDY)
    for mask in masks:
        assert set(mask) == {(experiment.id, kind) for experiment in STUDY.experiments for kind in experiment.kinds}
        for experiment in STUDY.experiments:
            letters = sorted(label for (of, _), label in mask.items() if of == experiment.id)
            assert letters == [f"Arm {letter}" for letter in "ABCDEFGH"[: len(experiment.kinds)]]
    assert len({tuple(mask.items()) for mask in masks}) > 1
    assert arm_labels(b"x", SCOPE, STUDY) == arm_labels(b"x", SCOPE, STUDY)


def test_the_letters_of_one_experiment_do_not_tell_those_of_another() -> None:
    first = STUDY.experiments[0].model_copy(update={"kinds": ("full", "subgoals", "random")})
    second = first.model_copy(update={"id": "second", "kinds": ("full", "random")})
    masks = masks_of(STUDY.model_copy(update={"experiments": (first, second)}))
    pairs = {(mask[first.id, "full"], mask["second", "full"]) for mask in masks}
    assert pairs == {(f"Arm {letter}", f"Arm {other}") for letter in "ABC" for other in "AB"}
