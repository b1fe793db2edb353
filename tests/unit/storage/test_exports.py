import csv
import io
from pathlib import Path

import pytest

from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.exports import PARTICIPANTS_COLUMNS, RATINGS_COLUMNS, ExportError, FileName, export, write_csv

GOLDEN = Path(__file__).parents[2] / "golden"


@pytest.mark.parametrize("name", ["ratings.csv", "participants.csv"])
def test_the_files_are_the_golden_ones_to_the_byte(database: Database, name: FileName) -> None:
    write_rows(database)
    file = io.BytesIO()
    with database.read() as connection:
        write_csv(connection, name, file)
    assert file.getvalue() == (GOLDEN / name).read_bytes()


def test_the_columns_are_the_promised_ones() -> None:
    promised = "study study_version mode participant experiment trial layout kind draw item rating response_time_ms"
    assert (*promised.split(), "submitted_at") == RATINGS_COLUMNS
    assert PARTICIPANTS_COLUMNS[:4] == RATINGS_COLUMNS[:4]


def test_an_export_reads_back_as_it_was_stored(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    assert export(database, tmp_path / "new" / "folder") == {"ratings.csv": 6, "participants.csv": 3}
    with (tmp_path / "new" / "folder" / "participants.csv").open(encoding="utf-8", newline="") as file:
        people = list(csv.DictReader(file))
    assert [person["num_pages_sent"] for person in people] == ["5", "3", "0"]
    assert people[2]["consent_version"] == 'April, "short"\nform'
    assert people[0]["assignment"] == "1/first/random/0 1/second/full"
    assert [bool(person["withdrawn_at"]) for person in people] == [False, True, False]


def test_an_empty_database_gives_headers_alone(database: Database, tmp_path: Path) -> None:
    assert export(database, tmp_path) == {"ratings.csv": 0, "participants.csv": 0}
    assert (tmp_path / "ratings.csv").read_bytes() == (",".join(RATINGS_COLUMNS) + "\r\n").encode()


@pytest.mark.parametrize("name", ["ratings.csv", "participants.csv"])
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
