import csv
import hashlib
import io
import json
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from tests.unit.storage.exported import LATER, STUDY, files_of, rows_of, texts_of, wanted_of
from tests.unit.storage.people import NOW, enrol_somebody
from tests.unit.storage.readers import read_described
from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.dataset import data_name, export, write_archive, write_dataset
from webapp.storage.exports import FILE_NAMES, ExportError
from webapp.storage.records import head
from webapp.storage.snapshot import snapshot
from webapp.storage.wanted import AS_STORED, Wanted

DATA_FILE = re.compile(r"data/([a-z]+-[A-Za-z0-9]+_)+data\.csv")
"""The name that Psych-DS wants: keywords and values, then `data`."""


def test_the_folder_is_as_psych_ds_wants_it(files: dict[str, bytes]) -> None:
    description = json.loads(files["dataset_description.json"])
    assert description["@context"] == "https://schema.org/"
    assert description["@type"] == "Dataset"
    assert all(description[name] for name in ("name", "description", "variableMeasured"))
    described = {variable["name"] for variable in description["variableMeasured"]}
    assert len(described) == len(description["variableMeasured"])
    ignored = files[".psychdsignore"].decode("ascii").split()
    others = {name for name in files if not name.startswith(("data/", *ignored))}
    assert others == {"dataset_description.json", "README.txt", ".psychdsignore"}
    tables = [name for name in files if name.startswith("data/") and name.endswith(".csv")]
    assert len(tables) == len(FILE_NAMES)
    found: set[str] = set()
    for name in tables:
        assert DATA_FILE.fullmatch(name)
        columns, *rows = list(csv.reader(io.StringIO(files[name].decode("utf-8"), newline="")))
        assert {len(row) for row in rows} <= {len(columns)}
        sidecar = json.loads(files[name.removesuffix(".csv") + ".json"])
        assert [variable["name"] for variable in sidecar["variableMeasured"]] == columns
        found |= set(columns)
    assert found == described


def test_every_variable_is_described_by_schema_orgs_properties_alone(files: dict[str, bytes]) -> None:
    known = {"@type", "name", "description", "additionalType", "unitText", "minValue", "maxValue", "valueReference"}
    for name in (name for name in files if name.endswith("_data.json") or name == "dataset_description.json"):
        for variable in json.loads(files[name])["variableMeasured"]:
            assert variable["@type"] == "PropertyValue"
            assert variable["description"].strip()
            assert set(variable) <= known
            assert variable["additionalType"].startswith("https://schema.org/")


def test_what_participants_read_is_in_the_description(files: dict[str, bytes]) -> None:
    variables = {one["name"]: one for one in json.loads(files["dataset_description.json"])["variableMeasured"]}
    assert {term["termCode"] for term in variables["mode"]["valueReference"]} == {"live", "test", "bot"}
    items = {term["termCode"]: term["name"] for term in variables["item"]["valueReference"]}
    experiment = STUDY.experiments[0]
    assert set(items) == {item.id for item in experiment.items}
    rating = variables[f"{experiment.id}.1.rating.{experiment.items[0].id}"]
    assert (rating["minValue"], rating["maxValue"]) == (1, experiment.items[0].points)
    assert items[experiment.items[0].id] in rating["description"]
    assert "In description-probes_data.csv" not in variables["rating"]["description"]
    assert all(part in variables["question"]["description"] for part in ("answers_data.csv:", "probes_data.csv:"))


def test_every_table_reads_back_by_its_description(live: Database, tmp_path: Path) -> None:
    num_rows = export(live, tmp_path / "out", wanted_of(live), LATER)
    assert [*num_rows] == [data_name(name) for name in FILE_NAMES]
    for name, count in num_rows.items():
        assert len(read_described(tmp_path / "out" / name)) == count
    ratings = read_described(tmp_path / "out" / data_name("ratings.csv"))
    assert set(ratings["rating"]) == {1, 2}
    assert ratings["submitted_at"].min() == NOW


def test_the_manifest_accounts_for_every_byte(live: Database, tmp_path: Path) -> None:
    export(live, tmp_path / "out", wanted_of(live), LATER)
    found = files_of(tmp_path / "out")
    manifest = json.loads(found.pop("manifest.json"))
    assert set(manifest["files"]) == set(found)
    for name, content in found.items():
        told = manifest["files"][name]
        assert (told["bytes"], told["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
        assert told["rows"] == (len(rows_of(content)) if name.endswith(".csv") else None)
    with live.read() as connection:
        end = head(connection)
    assert manifest["log"] == {"number": end.number, "hash": end.hash}
    assert manifest["made_at"] == "2031-04-01T12:00:00.000000Z"
    assert [study["participants"] for study in manifest["studies"]] == [3]


def test_nothing_in_a_data_set_says_who_somebody_is(live: Database, files: dict[str, bytes]) -> None:
    with live.read() as connection:
        kept = connection.exec_driver_sql("SELECT token_hash, salt FROM participants").all()
        sent = connection.exec_driver_sql("SELECT external_id FROM recruits").all()
    assert len(kept) == len(sent) == 3
    secrets = [str(value).encode() for row in (*kept, *sent) for value in row]
    for name, content in files.items():
        assert [secret for secret in secrets if secret in content] == [], name


def test_own_words_come_along_where_that_is_asked_for_and_the_folder_says_so(
    database: Database, tmp_path: Path
) -> None:
    write_rows(database)
    for name, wanted in (("without", Wanted()), ("with", AS_STORED)):
        export(database, tmp_path / name, wanted, LATER)
    told = {name: files_of(tmp_path / name) for name in ("without", "with")}
    assert "ロボット" not in "".join(content.decode("utf-8") for content in told["without"].values())
    assert "ロボット" in told["with"][data_name("answers.csv")].decode("utf-8")
    assert json.loads(told["with"]["manifest.json"])["with_free_text"] is True
    assert b"OWN WORDS ARE INCLUDED" in told["with"]["README.txt"]
    assert b"OWN WORDS ARE INCLUDED" not in told["without"]["README.txt"]


def test_an_archive_holds_the_same_files(live: Database, tmp_path: Path) -> None:
    export(live, tmp_path / "out", wanted_of(live), LATER)
    file = io.BytesIO()
    write_archive(live, file, wanted_of(live), LATER)
    with zipfile.ZipFile(file) as archive:
        assert archive.testzip() is None
        assert {name: archive.read(name) for name in archive.namelist()} == files_of(tmp_path / "out")


def test_an_empty_folder_may_be_there_and_a_full_one_or_a_file_may_not(database: Database, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    export(database, tmp_path / "empty", Wanted(), LATER)
    (tmp_path / "file").write_text("dear data")
    for name in ("empty", "file"):
        before = files_of(tmp_path)
        with pytest.raises(ExportError, match=f"{name} exists already"):
            export(database, tmp_path / name, Wanted(), LATER)
        assert files_of(tmp_path) == before


def test_a_folder_that_cannot_be_made_is_told_in_words(database: Database, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ExportError, match="file"):
        export(database, tmp_path / "file" / "folder", Wanted(), LATER)


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, RuntimeError])
def test_an_export_that_is_interrupted_leaves_nothing(
    database: Database, tmp_path: Path, interruption: type[BaseException]
) -> None:
    write_rows(database)
    asked: list[str] = []

    def interrupt(version: str) -> None:
        asked.append(version)
        if len(asked) > 5:
            raise interruption

    before = set(tmp_path.iterdir())
    with pytest.raises(interruption):
        export(database, tmp_path / "out", Wanted(find_bundle=interrupt), LATER)
    assert set(tmp_path.iterdir()) == before


def test_the_manifest_is_written_last_so_that_what_has_one_is_complete(live: Database) -> None:
    opened: list[str] = []

    class Listing:
        @contextmanager
        def open(self, name: str) -> Iterator[IO[bytes]]:
            opened.append(name)
            yield io.BytesIO()

    with snapshot(live) as connection:
        write_dataset(connection, Listing(), wanted_of(live), LATER)
    assert opened[-1] == "manifest.json"
    assert len(opened) == len(set(opened))


def test_whoever_exports_keeps_nobody_waiting_and_sees_one_state(live: Database) -> None:
    with snapshot(live) as connection:
        before = head(connection)
        enrol_somebody(live)
        assert head(connection) == before
        assert [path.name for path in live.path.parent.glob(".snapshot*")] == []
    with live.read() as connection:
        assert head(connection).number > before.number


def test_the_declared_rules_are_judged_for_everybody_who_can_be_judged(files: dict[str, bytes]) -> None:
    rows = rows_of(files[data_name("quality.csv")])
    people = [row["participant"] for row in rows_of(files[data_name("participants.csv")])]
    judged = {(row["participant"], row["rule"]): (row["value"], row["limit"], row["flagged"]) for row in rows}
    for number in (0, 1):
        assert judged[people[number], "straight_lining"] == (str(number + 1), "", "true")
        assert judged[people[number], "min_total_minutes"] == ("0.0", "1.0", "true")
        assert judged[people[number], "incomplete"] == ("", "", "false")
    assert people[2] not in {participant for participant, _ in judged}


def test_nobody_took_part_is_a_data_set_too(database: Database, tmp_path: Path) -> None:
    assert set(export(database, tmp_path / "out", Wanted(), LATER).values()) == {0}
    assert texts_of((tmp_path / "out" / "consort.svg").read_bytes()) == ["No participants."]
