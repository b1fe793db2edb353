import csv
import io
import json
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import insert

from tests.outside import outside
from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.export_columns import PARTICIPANTS_COLUMNS, names
from webapp.storage.exports import (
    COLUMNS,
    FILE_NAMES,
    RECRUITS,
    ExportError,
    FileName,
    RecruitsName,
    export_recruits,
    write_csv,
)
from webapp.storage.tables import page_restarts
from webapp.storage.wanted import AS_STORED, Wanted

GOLDEN = Path(__file__).parents[2] / "golden"
EVERY_FILE = pytest.mark.parametrize("name", [*FILE_NAMES, RECRUITS])
NOW = datetime(2031, 4, 1, tzinfo=UTC)


def written(
    database: Database, name: FileName | RecruitsName, wanted: Wanted = AS_STORED, *, for_spreadsheet: bool = False
) -> bytes:
    file = io.BytesIO()
    with database.read() as connection:
        write_csv(connection, name, file, wanted, for_spreadsheet=for_spreadsheet)
    return file.getvalue()


def table(
    database: Database, name: FileName | RecruitsName, wanted: Wanted = AS_STORED, *, for_spreadsheet: bool = False
) -> list[dict[str, str]]:
    content = written(database, name, wanted, for_spreadsheet=for_spreadsheet).decode("utf-8-sig")
    return list(csv.DictReader(io.StringIO(content, newline="")))


@EVERY_FILE
def test_the_files_are_the_golden_ones_to_the_byte(database: Database, name: FileName | RecruitsName) -> None:
    write_rows(database)
    assert written(database, name) == (GOLDEN / name).read_bytes()


def test_the_columns_are_the_promised_ones() -> None:
    promised = "study study_version mode participant experiment trial layout kind draw item rating response_time_ms"
    ratings = names(COLUMNS["ratings.csv"])
    assert (*promised.split(), "submitted_at") == ratings
    promised = (
        "study study_version mode participant consent_version consented_at last_seen_at completed_at withdrawn_at"
        " num_pages_sent num_pages assignment"
    )
    assert PARTICIPANTS_COLUMNS[:12] == tuple(promised.split())
    for name in FILE_NAMES:
        assert name == "wide.csv" or names(COLUMNS[name])[:4] == ratings[:4]
    for of_trials in ("probes.csv", "drives.csv", "events.csv"):
        assert names(COLUMNS[of_trials])[:9] == ratings[:9]


def test_no_file_but_the_one_apart_holds_ids_of_recruiters(database: Database) -> None:
    write_rows(database)
    for name in FILE_NAMES:
        for theirs in (b"0123456789abcdef01234567", b"fedcba987654321001234567", b"session12345", b"odd.id"):
            assert theirs not in written(database, name)
    assert set(names(COLUMNS[RECRUITS])) & set(PARTICIPANTS_COLUMNS) == {"study", "mode", "participant"}


def test_every_text_reads_back_as_it_was_stored(database: Database) -> None:
    write_rows(database)
    with outside(database) as connection:
        stored = connection.ask("SELECT question, answer FROM answers WHERE participant_id = 1")
    rows = [row for row in table(database, "answers.csv") if row["participant"] == "2345678abc"]
    assert sorted((row["question"], row["answer"]) for row in rows) == sorted(stored)
    people = table(database, "participants.csv")
    assert [person["num_pages_sent"] for person in people] == ["10", "7", "0", "0"]
    assert people[2]["consent_version"] == 'April, "short"\nform'
    assert people[0]["assignment"] == "1/first/random/0 1/second/full"
    assert [bool(person["withdrawn_at"]) for person in people] == [False, True, False, False]


def test_who_is_excluded_now_is_in_the_row_and_who_was_is_not(database: Database) -> None:
    write_rows(database)
    told = {
        row["participant"]: (row["excluded_at"], row["exclusion_reason"]) for row in table(database, "participants.csv")
    }
    assert told.pop("2345678abc") == ("2031-03-01T11:30:02.000017Z", 'said "no", twice')
    assert set(told.values()) == {("", "")}
    wide = {row["participant"]: row["excluded_at"] for row in table(database, "wide.csv")}
    assert [code for code, at in wide.items() if at] == ["2345678abc"]


def test_decisions_tell_who_decided_what_and_why_in_their_order(database: Database) -> None:
    write_rows(database)
    rows = table(database, "decisions.csv")
    assert [(row["participant"], row["action"], row["by"]) for row in rows] == [
        ("bcdefghjkm", "excluded", "ann"),
        ("bcdefghjkm", "included", "ann"),
        ("2345678abc", "excluded", "=ben"),
        ("2345678abc", "corrected", "ann"),
    ]
    assert [rows[3][name] for name in ("page", "file", "question", "to")] == ["1", "answers", "job", "researcher"]
    assert rows[3]["from"] == 'researcher, -3 years\r\nof "dreams"'


def test_the_ledger_tells_what_was_drawn_and_when_the_place_went_back(database: Database) -> None:
    write_rows(database)
    first, second = table(database, "allocation.csv")
    assert [json.loads(row["uses"]) for row in (first, second)] == [{"0/0": 1}, {"0/0": 2}]
    assert (first["released_at"], first["released_why"], first["draws"]) == ("", "", "0 7")
    assert (second["released_why"], second["resumed_at"]) == ("expired", "2031-03-01T10:50:00.000017Z")


@EVERY_FILE
def test_only_what_is_wanted_is_in_a_file(database: Database, name: FileName | RecruitsName) -> None:
    write_rows(database)
    everything = table(database, name)
    for wanted in (Wanted(mode="live", with_free_text=True), Wanted(study="odd", study_version="ff", mode="live")):
        kept = table(database, name, wanted)
        assert [row["participant"] for row in kept] == [
            row["participant"] for row in everything if row["mode"] == "live"
        ]
    for wanted in (Wanted(study="other"), Wanted(study_version="e"), Wanted(study_version="_")):
        assert table(database, name, wanted) == []


def test_own_words_are_left_out_unless_they_are_wanted_and_the_row_says_so(database: Database) -> None:
    write_rows(database)
    rows = [row for row in table(database, "answers.csv", Wanted()) if row["participant"] == "2345678abc"]
    withheld = {row["question"] for row in rows if row["is_withheld"] == "true"}
    assert withheld == {"email", "formula", "job", "phone", "return", "tab", "words"}
    assert all((row["answer"] == "") == (row["question"] in withheld) for row in rows)
    assert {row["is_withheld"] for row in table(database, "answers.csv")} == {"false"}
    for name in FILE_NAMES:
        assert "dreams" not in written(database, name, Wanted()).decode("utf-8")
        assert "ロボット" not in written(database, name, Wanted()).decode("utf-8")


def test_in_a_spreadsheet_a_text_that_would_be_run_gets_an_apostrophe_and_nothing_else_does(database: Database) -> None:
    write_rows(database)
    said = {row["question"]: row["answer"] for row in table(database, "answers.csv", for_spreadsheet=True)}
    assert {question: answer[1] for question, answer in said.items() if answer.startswith("'")} == {
        "age": "-",
        "email": "@",
        "formula": "=",
        "phone": "+",
        "return": "\r",
        "tab": "\t",
    }
    assert said["job"] == 'researcher, -3 years\r\nof "dreams"'
    assert said["words"] == "ロボット"


@EVERY_FILE
def test_a_spreadsheets_copy_says_its_encoding_and_no_cell_of_it_begins_like_a_formula(
    database: Database, name: FileName | RecruitsName
) -> None:
    write_rows(database)
    assert written(database, name, for_spreadsheet=True).startswith(b"\xef\xbb\xbf")
    assert not written(database, name).startswith(b"\xef\xbb\xbf")
    exact, copy = table(database, name), table(database, name, for_spreadsheet=True)
    cells = [cell for row in copy for cell in row.values()]
    assert not [cell for cell in cells if cell[:1] in {"=", "+", "-", "@", "\t", "\r"}]
    copied, stored = (
        [{column: cell.replace("'", "") for column, cell in row.items()} for row in rows] for rows in (copy, exact)
    )
    assert copied == stored


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("participants.csv", ["guardian_agreed"]),
        ("answers.csv", ["is_correct"]),
        ("probes.csv", ["is_correct", "is_as_good"]),
    ],
)
def test_what_is_so_or_not_is_true_or_false_and_empty_where_nobody_knows(
    database: Database, name: FileName, columns: list[str]
) -> None:
    write_rows(database)
    found = {row[column] for row in table(database, name) for column in columns}
    assert found == {"true", "false"} if name == "probes.csv" else {"true", "false", ""}


def test_a_drive_that_was_not_finished_is_in_the_events_alone(database: Database) -> None:
    write_rows(database)
    for person, is_finished in {"2345678abc": True, "bcdefghjkm": False}.items():
        drives = [row for row in table(database, "drives.csv") if row["participant"] == person]
        taken = [
            (row["experiment"], row["trial"], row["kind"], row["page_kind"], row["value"])
            for row in table(database, "events.csv")
            if (row["participant"], row["page"], row["event"]) == (person, "10", "drive_action")
        ]
        assert [row["phase"] for row in drives] == ["practice", "before", "after"][: 3 if is_finished else 2]
        assert taken == [("1", "2", "full", "drive", "toggle")] * 3


def test_the_actions_of_a_drive_are_the_same_in_both_files(database: Database) -> None:
    write_rows(database)
    rows = table(database, "events.csv")
    for drive in table(database, "drives.csv"):
        kinds = {"practice": "practice", "before": "first_drive", "after": "drive"}
        own = [
            row
            for row in rows
            if (row["participant"], row["trial"]) == (drive["participant"], drive["trial"])
            and (row["event"], row["page_kind"]) == ("drive_action", kinds[drive["phase"]])
        ]
        assert [row["value"] for row in own] == drive["actions"].split()
        assert [int(row["target"]) for row in own] == list(range(1, int(drive["num_steps"]) + 1))
        assert drive["started_at"] == (own[0]["received_at"] if own else "")


def test_an_empty_database_gives_headers_alone(database: Database) -> None:
    promised: dict[FileName | RecruitsName, tuple[str, ...]] = {
        "ratings.csv": names(COLUMNS["ratings.csv"]),
        "events.csv": names(COLUMNS["events.csv"]),
        "decisions.csv": names(COLUMNS["decisions.csv"]),
        RECRUITS: names(COLUMNS[RECRUITS]),
    }
    for name, columns in promised.items():
        assert written(database, name) == (",".join(columns) + "\r\n").encode()


def test_recruits_go_into_a_file_of_their_own_that_only_its_owner_may_read(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    path = tmp_path / "to-be-paid.csv"
    previous = os.umask(0)
    try:
        assert export_recruits(database, path, NOW) == 3
    finally:
        os.umask(previous)
    assert path.read_bytes() == (GOLDEN / RECRUITS).read_bytes()
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("what", ["a file", "a folder"])
def test_recruits_overwrite_nothing(database: Database, tmp_path: Path, what: str) -> None:
    path = tmp_path / "recruits.csv"
    if what == "a file":
        path.write_text("dear data")
    else:
        path.mkdir()
    with pytest.raises(ExportError, match=r"recruits\.csv exists already; choose another file"):
        export_recruits(database, path, NOW)
    assert path.is_dir() or path.read_text() == "dear data"


def test_a_file_in_a_folder_that_is_not_there_is_told_in_words(database: Database, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"missing/recruits\.csv: No such file"):
        export_recruits(database, tmp_path / "missing" / "recruits.csv", NOW)


def test_that_recruits_were_written_is_recorded_and_a_refusal_is_not(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    export_recruits(database, tmp_path / "recruits.csv", NOW)
    with pytest.raises(ExportError):
        export_recruits(database, tmp_path / "recruits.csv", NOW)
    with outside(database) as connection:
        query = "SELECT actor, content FROM records JOIN record_contents USING (number) WHERE action = 'downloaded'"
        assert connection.execute(query).fetchall() == [("(command line)", '{"file":"recruits.csv"}')]


def test_what_was_driven_before_a_drive_was_begun_anew_is_in_the_events_alone(database: Database) -> None:
    write_rows(database)
    with database.write() as connection:
        row = {"participant_id": 1, "page_number": 10, "number": 1, "after_step": 1, "after_attempt": 0, "at": NOW}
        connection.execute(insert(page_restarts).values(row))
    (drive,) = [
        row for row in table(database, "drives.csv") if (row["participant"], row["phase"]) == ("2345678abc", "after")
    ]
    taken = [row for row in table(database, "events.csv") if (row["participant"], row["page"]) == ("2345678abc", "10")]
    assert drive["actions"] == "toggle toggle"
    assert drive["started_at"] == taken[1]["received_at"]
    assert len(taken) == 3
