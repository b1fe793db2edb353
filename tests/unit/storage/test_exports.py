import csv
import io
import os
from pathlib import Path

import pytest

from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.export_columns import (
    ANSWERS_COLUMNS,
    DRIVES_COLUMNS,
    EVENTS_COLUMNS,
    PARTICIPANTS_COLUMNS,
    PROBES_COLUMNS,
    RATINGS_COLUMNS,
    RECRUITS_COLUMNS,
)
from webapp.storage.exports import (
    FILE_NAMES,
    RECRUITS,
    ExportError,
    FileName,
    RecruitsName,
    export,
    export_recruits,
    write_csv,
)

GOLDEN = Path(__file__).parents[2] / "golden"
EVERY_FILE = pytest.mark.parametrize("name", [*FILE_NAMES, RECRUITS])
NUM_ROWS = {
    "ratings.csv": 6,
    "participants.csv": 4,
    "answers.csv": 24,
    "probes.csv": 4,
    "drives.csv": 5,
    "events.csv": 20,
}


def written(database: Database, name: FileName | RecruitsName) -> bytes:
    file = io.BytesIO()
    with database.read() as connection:
        write_csv(connection, name, file)
    return file.getvalue()


def table(database: Database, name: FileName | RecruitsName) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(written(database, name).decode("utf-8"), newline="")))


@EVERY_FILE
def test_the_files_are_the_golden_ones_to_the_byte(database: Database, name: FileName | RecruitsName) -> None:
    write_rows(database)
    assert written(database, name) == (GOLDEN / name).read_bytes()


def test_the_columns_are_the_promised_ones() -> None:
    promised = "study study_version mode participant experiment trial layout kind draw item rating response_time_ms"
    assert (*promised.split(), "submitted_at") == RATINGS_COLUMNS
    promised = (
        "study study_version mode participant consent_version consented_at last_seen_at completed_at withdrawn_at"
        " num_pages_sent num_pages assignment"
    )
    assert PARTICIPANTS_COLUMNS[:12] == tuple(promised.split())
    for columns in (PARTICIPANTS_COLUMNS, ANSWERS_COLUMNS, PROBES_COLUMNS, DRIVES_COLUMNS, EVENTS_COLUMNS):
        assert columns[:4] == RATINGS_COLUMNS[:4]
    for columns in (PROBES_COLUMNS, DRIVES_COLUMNS, EVENTS_COLUMNS):
        assert columns[:9] == RATINGS_COLUMNS[:9]


def test_no_file_but_the_one_apart_holds_ids_of_recruiters(database: Database) -> None:
    write_rows(database)
    for name in FILE_NAMES:
        for outside in (b"0123456789abcdef01234567", b"fedcba987654321001234567", b"session12345", b"odd.id"):
            assert outside not in written(database, name)
    assert set(RECRUITS_COLUMNS) & set(PARTICIPANTS_COLUMNS) == {"study", "mode", "participant"}


def test_an_export_reads_back_as_it_was_stored(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    assert export(database, tmp_path / "new" / "folder") == NUM_ROWS
    with (tmp_path / "new" / "folder" / "participants.csv").open(encoding="utf-8", newline="") as file:
        people = list(csv.DictReader(file))
    assert [person["num_pages_sent"] for person in people] == ["10", "7", "0", "0"]
    assert people[2]["consent_version"] == 'April, "short"\nform'
    assert people[0]["assignment"] == "1/first/random/0 1/second/full"
    assert [bool(person["withdrawn_at"]) for person in people] == [False, True, False, False]
    assert not (tmp_path / "new" / "folder" / RECRUITS).exists()


def test_a_text_that_a_spreadsheet_would_run_gets_an_apostrophe_and_no_other_does(database: Database) -> None:
    write_rows(database)
    said = {row["question"]: row["answer"] for row in table(database, "answers.csv")}
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
    assert "'-odd.id" in {row["external_id"] for row in table(database, RECRUITS)}


@EVERY_FILE
def test_no_cell_of_any_file_begins_like_a_formula(database: Database, name: FileName | RecruitsName) -> None:
    write_rows(database)
    cells = [cell for row in table(database, name) for cell in row.values()]
    assert cells
    assert not [cell for cell in cells if cell[:1] in {"=", "+", "-", "@", "\t", "\r"}]


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


def test_an_empty_database_gives_headers_alone(database: Database, tmp_path: Path) -> None:
    assert export(database, tmp_path) == dict.fromkeys(FILE_NAMES, 0)
    assert export_recruits(database, tmp_path / RECRUITS) == 0
    for name, columns in (
        ("ratings.csv", RATINGS_COLUMNS),
        ("events.csv", EVENTS_COLUMNS),
        (RECRUITS, RECRUITS_COLUMNS),
    ):
        assert (tmp_path / name).read_bytes() == (",".join(columns) + "\r\n").encode()


@pytest.mark.parametrize("name", FILE_NAMES)
def test_nothing_is_overwritten(database: Database, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("dear data")
    with pytest.raises(ExportError, match=f"{name} exists already"):
        export(database, tmp_path)
    assert [path.name for path in tmp_path.glob("*.csv")] == [name]
    assert (tmp_path / name).read_text() == "dear data"


def test_a_folder_that_cannot_be_made_is_told_in_words(database: Database, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ExportError, match="file"):
        export(database, tmp_path / "file" / "folder")


def test_recruits_go_into_a_file_of_their_own_that_only_its_owner_may_read(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    path = tmp_path / "to-be-paid.csv"
    previous = os.umask(0)
    try:
        assert export_recruits(database, path) == 3
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
        export_recruits(database, path)
    assert path.is_dir() or path.read_text() == "dear data"


def test_a_file_in_a_folder_that_is_not_there_is_told_in_words(database: Database, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"missing/recruits\.csv: No such file"):
        export_recruits(database, tmp_path / "missing" / "recruits.csv")
