"""The chain of records: what it holds, and that nothing can be changed, cut out or slipped in without being seen."""

import re
from datetime import timedelta

import pytest

from tests.outside import on_disk, outside
from tests.unit.storage.people import DRIVING, NOW, at_once, enrol_somebody, page_of_kind, send, walk, walk_to
from webapp.storage.accounts import create_researcher
from webapp.storage.answers import store_step
from webapp.storage.contents import Stored, page_rows
from webapp.storage.database import Database
from webapp.storage.erasure import erase
from webapp.storage.helping import restart_page
from webapp.storage.participants import Participant, withdraw
from webapp.storage.people import exclude, note
from webapp.storage.records import FIRST_HASH, Entry, append, canonical, content_digest, head, told_by
from webapp.storage.tables import ANSWER_TABLES
from webapp.storage.verification import verify_log
from webapp.study.answers import Answer, DriveStep, PageContent


def tamper(database: Database, *statements: str) -> None:
    """Change the file behind the program's back: triggers and foreign keys do not stop whoever owns it."""
    with outside(database) as connection:
        connection.disarm()
        for statement in statements:
            assert connection.execute(statement).rowcount > 0
        connection.commit()


@pytest.fixture
def people(database: Database) -> list[Participant]:
    """Somebody who finished, somebody who left, somebody in the middle of a drive, an excluded one."""
    create_researcher(database, "ann", "correct horse battery", NOW, "viewer")
    done, left = enrol_somebody(database), enrol_somebody(database)
    walk(database, done, 11)
    walk(database, left, 4)
    withdraw(database, left, NOW)
    driving = enrol_somebody(database, study=DRIVING)
    page = walk_to(database, driving, "quiz", DRIVING)
    for attempt in (1, 2):
        answers = (Answer("goal", "key", is_correct=False),)
        content = PageContent(answers=answers, attempt=attempt, is_final=attempt == 2)
        assert send(database, driving, page.number, study=DRIVING, content=content) == "accept"
    drive = page_of_kind(database, driving, "drive", DRIVING)
    for number in range(page.number + 1, drive.number):
        assert send(database, driving, number, study=DRIVING) == "accept"
    for number, action in enumerate(("left", "forward"), start=1):
        assert store_step(database, driving, drive, DriveStep(number, action, 250), NOW) == "accept"
    exclude(database, done.code, "was in the pilot", "boss", NOW)
    note(database, done.code, "called us", "boss", NOW)
    return [done, left, driving]


@pytest.mark.usefixtures("people")
def test_every_record_names_the_one_before(database: Database) -> None:
    with outside(database) as connection:
        rows = connection.ask("SELECT number, previous_hash, hash FROM records ORDER BY number")
    assert [number for number, *_ in rows] == list(range(1, len(rows) + 1))
    assert [previous for _, previous, _ in rows] == [FIRST_HASH, *(current for *_, current in rows[:-1])]
    with database.read() as connection:
        assert head(connection).number == len(rows)


@pytest.mark.usefixtures("people")
def test_all_is_well_with_what_nobody_touched(database: Database) -> None:
    found = verify_log(database)
    assert found.problems == ()
    assert (found.num_erased, found.num_unvouched) == (0, 0)


def test_the_same_content_has_the_same_digest_and_a_salt_another() -> None:
    assert content_digest("a", {"x": 1, "y": [NOW]}) == content_digest("a", {"y": [NOW], "x": 1})
    assert content_digest("a", {"x": 1}) != content_digest("b", {"x": 1})
    assert canonical({"at": NOW, "word": "鍵"}) == '{"at":"2031-03-01T09:30:00.000017Z","word":"鍵"}'
    with pytest.raises(TypeError, match="cannot be recorded"):
        canonical({"x": object()})


@pytest.mark.usefixtures("people")
def test_records_can_only_be_added(database: Database) -> None:
    for table in ("records", "record_contents"):
        for statement in (f"UPDATE {table} SET number = number", f"DELETE FROM {table}"):  # noqa: S608
            with pytest.raises(Exception, match=f"rows of {table}"), database.write() as connection:
                connection.exec_driver_sql(statement)


@pytest.mark.usefixtures("people")
@pytest.mark.parametrize(
    ("statements", "problem"),
    [
        (["UPDATE records SET actor = 'other' WHERE action = 'excluded'"], "is not what its hash says"),
        (["UPDATE records SET at = '2031-03-01 10:30:00.000000' WHERE number = 5"], r"record 5 \("),
        (["DELETE FROM record_contents WHERE number = 7", "DELETE FROM records WHERE number = 7"], "are missing"),
        (["UPDATE records SET previous_hash = hash WHERE number = 3"], "does not continue the chain"),
        (["UPDATE ratings SET rating = 5 WHERE page_number = 3"], r"sent, page 3\): what it tells was changed"),
        (["DELETE FROM ratings WHERE page_number = 5 AND item = 'general'"], r"sent, page 5\)"),
        (["UPDATE trials SET kind = 'full' WHERE number = 1 AND kind != 'full'"], "consented"),
        (["UPDATE drive_steps SET action = 'right' WHERE number = 2"], "acted"),
        (["UPDATE answers SET is_correct = TRUE WHERE attempt = 1"], "attempted"),
        (["UPDATE participants SET language = 'ja'"], "consented"),
        (["UPDATE record_contents SET content = '{\"reason\":\"none\"}' WHERE content LIKE '%pilot%'"], "excluded"),
        (["DELETE FROM record_contents WHERE content LIKE '%pilot%'"], "has lost what it tells"),
        (["UPDATE record_contents SET participant_id = 2 WHERE content LIKE '%pilot%'"], "somebody else"),
        (["UPDATE participants SET completed_at = NULL"], "completed_at does not go with"),
        (
            ["UPDATE participants SET completed_at = '2041-01-01 00:00:00.000000' WHERE completed_at IS NOT NULL"],
            "completed_at",
        ),
        (["UPDATE participants SET screened_out_at = consented_at WHERE completed_at IS NULL"], "sent, page"),
        (["UPDATE participants SET last_seen_at = '2041-01-01 00:00:00.000000'"], "last_seen_at does not go"),
        (["UPDATE participants SET slot_released_at = consented_at"], "slot_released_at or returned_late_at"),
        (["UPDATE participants SET returned_late_at = consented_at"], "slot_released_at or returned_late_at"),
        (["UPDATE record_contents SET page_number = 2 WHERE content LIKE '%pilot%'"], "about another page"),
        (["UPDATE record_contents SET content = '{}', page_number = NULL WHERE part = 2"], "tells was changed"),
        (["INSERT INTO participant_tokens VALUES ('x', 1, '2031-03-01 09:30:00.000000')"], "1 links are stored, and 0"),
        (["UPDATE participants SET withdrawn_at = NULL"], "withdrawn_at does not go with"),
        (["UPDATE participants SET withdrawn_at = consented_at WHERE withdrawn_at IS NULL"], "withdrawn_at"),
        (["DELETE FROM drive_steps WHERE number = 2"], "acted"),
        (["UPDATE researchers SET role = 'admin'"], "account 'ann' is admin, and was recorded as viewer"),
        (["UPDATE researchers SET name = 'bob'"], "account 'bob' is viewer, and was recorded as none"),
    ],
)
def test_a_change_behind_the_programs_back_is_found(database: Database, statements: list[str], problem: str) -> None:
    tamper(database, *statements)
    assert re.search(problem, "\n".join(verify_log(database).problems))


def test_rows_that_were_slipped_in_are_found(database: Database, people: list[Participant]) -> None:
    _, _, driving = people
    page = page_of_kind(database, driving, "drive", DRIVING).number
    tamper(
        database,
        f"INSERT INTO drive_steps SELECT participant_id, page_number, 3, page_kind, trial_number, action, elapsed_ms, "  # noqa: S608
        f"received_at FROM drive_steps WHERE number = 2 AND page_number = {page}",
        "INSERT INTO answers SELECT participant_id, page_number, 3, question, purpose, answer, is_correct, "
        "submitted_at FROM answers WHERE attempt = 2",
        f"INSERT INTO pages SELECT participant_id, {page}, 'drive', trial_number, 'n', submitted_at FROM pages "  # noqa: S608
        f"WHERE participant_id = {driving.id} AND number = {page - 1}",
    )
    problems = " ".join(verify_log(database).problems)
    for what in ("3 actions of drives are stored, and 2", "3 attempts are stored, and 2"):
        assert f"participant {driving.code}: {what} were recorded" in problems
    assert f"participant {driving.code}: {page} pages are stored, and {page - 1} were recorded" in problems


def test_a_whole_participant_who_was_slipped_in_is_found(database: Database, people: list[Participant]) -> None:
    with outside(database) as connection:
        columns = connection.columns("participants")
    changes = {"id": "99", "code": "'slippedin2'", "token_hash": "'x'"}
    values = ", ".join(changes.get(name, name) for name in columns)
    tamper(database, f"INSERT INTO participants SELECT {values} FROM participants WHERE id = {people[0].id}")  # noqa: S608
    assert "participant slippedin2: is there, and was never recorded" in verify_log(database).problems


def test_a_whole_participant_who_was_removed_is_found(database: Database, people: list[Participant]) -> None:
    who = people[0].id
    tables = ("record_contents", *(table.name for table in reversed(ANSWER_TABLES)))
    with outside(database) as connection:
        connection.disarm()
        kept = "number IN (SELECT number FROM records WHERE action IN ('allocated', 'slot_released', 'slot_resumed'))"
        connection.execute(f"UPDATE record_contents SET participant_id = NULL WHERE participant_id = {who} AND {kept}")  # noqa: S608
        for table in tables:
            connection.execute(f"DELETE FROM {table} WHERE participant_id = {who}")  # noqa: S608
        connection.execute("DELETE FROM participants WHERE id = ?", (who,))
        connection.commit()
    (problem,) = verify_log(database).problems
    assert "is gone, and no erasure was recorded" in problem


@pytest.mark.usefixtures("people")
def test_a_log_that_was_cut_off_or_written_anew_is_found_by_a_head_that_was_noted_down(
    database: Database,
) -> None:
    with database.read() as connection:
        noted = head(connection)
    assert verify_log(database, known=(noted.number, noted.hash)).problems == ()
    tamper(
        database,
        f"DELETE FROM record_contents WHERE number = {noted.number}",  # noqa: S608
        f"DELETE FROM records WHERE number = {noted.number}",  # noqa: S608
    )
    assert verify_log(database).problems == ()
    (problem,) = verify_log(database, known=(noted.number, noted.hash)).problems
    assert str(noted.number) in problem


def test_what_began_before_the_log_is_said_not_to_be_vouched_for(database: Database) -> None:
    enrol_somebody(database)
    tamper(database, "UPDATE record_contents SET participant_id = NULL WHERE number = 2")
    assert verify_log(database).num_unvouched == 1


def test_someone_erased_leaves_nothing_behind_and_the_chain_holds(
    database: Database, people: list[Participant]
) -> None:
    done, left, _ = people
    with database.read() as connection:
        before = head(connection)
    for person in (done, left):
        erase(database, person.code, "boss", NOW + timedelta(days=1))
    found = verify_log(database, known=(before.number, before.hash))
    assert found.problems == ()
    assert found.num_erased > 11
    content = on_disk(database)
    for secret in (done.code, done.token_hash, done.salt, "was in the pilot", "called us", left.code):
        assert secret.encode() not in content
    assert people[2].code.encode() in content


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE page_restarts SET after_step = 0",
        "DELETE FROM page_restarts",
        "UPDATE record_contents SET page_number = 2 WHERE content LIKE '%froze%'",
        "UPDATE record_contents SET participant_id = NULL WHERE number = 2",
    ],
)
def test_a_changed_restart_or_owner_of_a_place_is_found(
    database: Database, people: list[Participant], statement: str
) -> None:
    page = page_of_kind(database, people[2], "drive", DRIVING).number
    restart_page(database, people[2].code, page, "the window froze", "boss", NOW)
    assert verify_log(database).problems == ()
    tamper(database, statement)
    assert len(verify_log(database).problems) >= 1


def test_answers_are_read_even_where_a_record_was_given_words_of_its_own(
    database: Database, people: list[Participant]
) -> None:
    with database.read() as connection:
        before = canonical(page_rows(Stored(connection), people[0].id, 3, None))
    tamper(
        database,
        f"UPDATE record_contents SET content = '{before}' WHERE participant_id = {people[0].id} AND page_number = 3",  # noqa: S608
        "UPDATE ratings SET rating = 5 WHERE page_number = 3",
    )
    assert "sent, page 3): what it tells was changed" in " ".join(verify_log(database).problems)


def test_an_erased_persons_restart_goes_with_them(database: Database, people: list[Participant]) -> None:
    driving = people[2]
    page = page_of_kind(database, driving, "drive", DRIVING).number
    restart_page(database, driving.code, page, "the window froze", "boss", NOW)
    assert verify_log(database).problems == ()
    erase(database, driving.code, "boss", NOW)
    assert verify_log(database).problems == ()
    with database.read() as connection:
        assert list(told_by(connection, "page_restarted")) == []


def test_simultaneous_writers_keep_one_chain(database: Database) -> None:
    def write(number: int) -> None:
        with database.write() as connection:
            append(connection, Entry(NOW, f"writer {number}", "signed_in"))

    at_once(16, write)
    assert verify_log(database).problems == ()
    assert verify_log(database).head.number == 16
