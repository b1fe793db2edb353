"""Mistakes in a data set: each is told with file, line, column, value and what is wanted."""

import io
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from tests.unit.reports.data_sets import (
    ITEMS,
    PEOPLE,
    STUDY_FILE,
    VERSION,
    Tables,
    decision,
    flag,
    tables,
    text_of,
    write_exported,
    write_plain,
)
from webapp.reports import read_folder
from webapp.reports.read_columns import FORMS
from webapp.reports.read_folder import DataFiles
from webapp.reports.reading import DataSet, DataSetError, read_dataset
from webapp.reports.selection import select

GOLDEN = Path(__file__).parents[2] / "golden"
REPEATED = "participant 'person0', experiment '1', trial 1, item 'likeliness'"
TRIAL = "trial 1 of experiment '1' of participant 'person0'"
NOBODY = "nobody of that name, study, version and mode; add the row there"


def problems_of(path: Path, *, changed_ok: bool = False) -> list[str]:
    with pytest.raises(DataSetError) as error:
        read_dataset(path, changed_ok=changed_ok)
    assert str(error.value) == "\n".join(error.value.problems)
    return list(error.value.problems)


def spoiled(tmp_path: Path, spoil: Callable[[Tables], object]) -> list[str]:
    """What is said of a plain folder after one change of its rows."""
    data = tables()
    spoil(data)
    return problems_of(write_plain(tmp_path, data))


def after(content: bytes, tmp_path: Path) -> list[str]:
    """What is said of a file of ratings with this content."""
    (tmp_path / "ratings.csv").write_bytes(content)
    return problems_of(tmp_path)


def set_cell(table: str, row: int, **values: str) -> Callable[[Tables], object]:
    return lambda data: data[table][row].update(values)


def drop(table: str, column: str) -> Callable[[Tables], object]:
    return lambda data: [row.pop(column) for row in data[table]]


def read(data: Tables, folder: Path) -> DataSet:
    return read_dataset(write_plain(folder, data))


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (
            set_cell("ratings", 1, rating="12"),
            "ratings.csv, line 3, rating: is '12'; use a whole number from 1 to 11; no study file is beside it, and no",
        ),
        (
            set_cell("ratings", 1, rating="0"),
            "ratings.csv, line 3, rating: is '0'; use a whole number from 1, the lowest answer of every scale",
        ),
        (set_cell("ratings", 1, rating="-2.0"), "ratings.csv, line 3, rating: is '-2.0'; use a whole number from 1, "),
        (set_cell("ratings", 0, rating="3.5"), "ratings.csv, line 2, rating: is '3.5'; use a whole number from 1"),
        (set_cell("ratings", 0, rating="٣"), "ratings.csv, line 2, rating: is '٣'; use a whole number from 1"),
        (set_cell("ratings", 0, rating="9" * 30), f"ratings.csv, line 2, rating: is '{'9' * 30}'; use a whole number"),
        (set_cell("ratings", 0, rating=""), "ratings.csv, line 2, rating: is empty; use a whole number from 1"),
        (set_cell("ratings", 0, rating="NA"), "ratings.csv, line 2, rating: is 'NA'; use a whole number from 1"),
        (set_cell("ratings", 4, kind=""), "ratings.csv, line 6, kind: is empty; write something"),
        (
            set_cell("ratings", 0, mode="life"),
            "ratings.csv, line 2, mode: is 'life'; use live, test or bot",
        ),
        (set_cell("ratings", 0, mode=""), "ratings.csv, line 2, mode: is empty; use live, test or bot"),
        (
            set_cell("ratings", 0, response_time_ms="-5"),
            "ratings.csv, line 2, response_time_ms: is '-5'; use a whole number from 0 to 86400000",
        ),
        (
            set_cell("ratings", 0, submitted_at="01.03.2031 09:30"),
            "ratings.csv, line 2, submitted_at: is '01.03.2031 09:30'; use a time in UTC such as",
        ),
        (
            set_cell("ratings", 0, submitted_at="2031-02-30T09:30:00Z"),
            "ratings.csv, line 2, submitted_at: is '2031-02-30T09:30:00Z'; use a time in UTC",
        ),
        (
            set_cell("participants", 0, completed_at="2031-03-01T09:00:00Z"),
            "participants.csv, line 2, completed_at: is '2031-03-01T09:00:00Z'; use a time after consented_at, or none",
        ),
        (
            set_cell("participants", 1, withdrawn_at="2031-03-01T11:00:00Z"),
            "participants.csv, line 3: has both completed_at and withdrawn_at; nobody leaves a study twice",
        ),
        (
            lambda data: data["ratings"].append(dict(data["ratings"][0])),
            f"ratings.csv, line 92: repeats line 2: {REPEATED}; keep one",
        ),
        (
            lambda data: data["participants"].append(dict(data["participants"][2])),
            "participants.csv, line 8: repeats line 4: participant 'person2'; keep one",
        ),
        (
            set_cell("ratings", 1, kind="random"),
            f"ratings.csv, line 3: {TRIAL} has the kind 'random', and 'full' on line 2; a trial has one kind",
        ),
        (
            set_cell("ratings", 2, layout="elsewhere"),
            f"ratings.csv, line 4: {TRIAL} has the layout 'elsewhere', and 'experiment1-a' on line 2; a trial has one",
        ),
        (
            lambda data: data["participants"].pop(0),
            f"ratings.csv, line 2, participant: is 'person0'; participants.csv has {NOBODY}",
        ),
        (drop("ratings", "rating"), "ratings.csv: has no column 'rating'; add it"),
        (drop("participants", "completed_at"), "participants.csv: has no column 'completed_at'; add it"),
        (
            lambda data: [row.update(kindd=row.pop("kind")) for row in data["ratings"]],
            "ratings.csv: has no column 'kind', but 'kindd'; did you mean that one?",
        ),
        (
            lambda data: data["quality"].append(flag("person0", "incomplete") | {"flagged": "yes"}),
            "quality.csv, line 2, flagged: is 'yes'; use true or false",
        ),
        (
            lambda data: data["decisions"].append(decision("person0", "excused", 9)),
            "decisions.csv, line 2, action: is 'excused'; use excluded, included, corrected, page_released or page_",
        ),
    ],
)
def test_a_mistake_is_told_with_its_place_its_value_and_a_wish(
    spoil: Callable[[Tables], object], problem: str, tmp_path: Path
) -> None:
    told = spoiled(tmp_path, spoil)
    assert told[0].startswith(problem)
    assert not told[1:] or problem.endswith(NOBODY)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "ratings.csv: is empty; its first line should have the names of the columns"),
        (b"\xef\xbb\xbf\r\n\r\n", "ratings.csv: is empty"),
        (
            text_of([], list(tables()["ratings"][0])).encode(),
            "ratings.csv: has no rows, so there is nothing to analyse",
        ),
        (
            b"a,b\r\n1,2\r\n1,2,3\r\n1\r\n",
            "ratings.csv, line 3: has 3 cells, and the first line has 2; make them equal",
        ),
        (b"a,b\r\n1,\x00\r\n", "ratings.csv, line 2: holds the byte 0x00; the file is damaged or in UTF-16 without"),
        (b'a,b\r\n1,"2\r\n', "ratings.csv, line 2: is no CSV: unexpected end of data; check the quotes there"),
        (b'a,b\r\n"1"x,2\r\n', "ratings.csv, line 2: is no CSV: ',' expected after '\"'; check the quotes there"),
        (
            b"a;b;c\r\n1;2;3\r\n",
            "ratings.csv, line 1: has semicolons between the columns: 'a;b;c'; save it with commas",
        ),
        (b"a\tb\r\n1\t2\r\n", "ratings.csv, line 1: has tabs between the columns: 'a\\tb'; save it with commas"),
        (b"kind,item,kind\r\n1,2,3\r\n", "ratings.csv, line 1: has the column 'kind' 2 times; keep one"),
        (b"a,b\r\nx,caf\xe9\r\n", "ratings.csv, line 2: the byte 0xE9 cannot be read as UTF-8; the file is in another"),
        ("a,日\r\n".encode("shift-jis"), "ratings.csv, line 1: the byte 0x93 cannot be read as UTF-8"),
        ("a,b\r\n".encode("utf-16-le"), "ratings.csv, line 1: holds the byte 0x00"),
        (b"\xff\xfea\x00\n\x00\x00\xd8", "ratings.csv, line 2: the byte 0x00 cannot be read as UTF-16"),
        ("a,b\r\n1,2\r\n".encode("utf-32"), "ratings.csv: is in UTF-32; save it as UTF-8"),
        (b"a,b\r\n1," + b"x" * 200_000 + b"\r\n", "ratings.csv, line 2: is no CSV: field larger than field limit"),
    ],
)
def test_a_file_that_is_no_table_is_told_with_its_line(content: bytes, problem: str, tmp_path: Path) -> None:
    assert after(content, tmp_path)[0].startswith(problem)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("line_end", ["\r\n", "\n", "\r"])
def test_an_encoding_that_says_what_it_is_and_any_line_end_are_read(
    encoding: str, line_end: str, tmp_path: Path
) -> None:
    rows = tables()["ratings"]
    for row in rows:
        row["layout"] = row["layout"].replace("experiment", "実験")
    text = text_of(rows).replace("\r\n", line_end)
    (tmp_path / "ratings.csv").write_bytes(text.encode(encoding))
    found = read_dataset(tmp_path / "ratings.csv").tables["ratings"]
    assert list(found["layout"]) == [row["layout"] for row in rows]


def test_of_many_mistakes_of_a_file_twenty_are_told_and_the_others_counted(tmp_path: Path) -> None:
    data = tables()
    for row in data["ratings"]:
        row["rating"] = "seven"
    data["participants"][0]["completed_at"] = "yesterday"
    told = problems_of(write_plain(tmp_path, data))
    assert told[:2] == [
        "ratings.csv, line 2, rating: is 'seven'; use a whole number from 1, the lowest answer of every scale",
        "ratings.csv, line 3, rating: is 'seven'; use a whole number from 1, the lowest answer of every scale",
    ]
    assert told[20] == "ratings.csv: and 70 more problems"
    assert told[21].startswith("participants.csv, line 2, completed_at: is 'yesterday'")
    assert len(told) == 22


def test_lines_are_counted_as_an_editor_does_where_a_cell_has_line_breaks(tmp_path: Path) -> None:
    data = tables()
    data["decisions"] = [
        decision("person0", "excluded", 1) | {"reason": "first\nsecond\r\nthird"},
        decision("person1", "excused", 2),
    ]
    (problem,) = problems_of(write_plain(tmp_path, data))
    assert problem.startswith("decisions.csv, line 5, action: is 'excused'")


def test_all_types_are_as_the_contract_says(tmp_path: Path) -> None:
    found = read_dataset(write_exported(tmp_path, tables(), STUDY_FILE.read_bytes()))
    ratings, people = found.tables["ratings"], found.tables["participants"]
    assert ratings["rating"].dtype == ratings["trial"].dtype == "int64"
    assert ratings["draw"].dtype == ratings["response_time_ms"].dtype == "Int64"
    assert isinstance(ratings["kind"].dtype, pd.StringDtype)
    assert str(people["completed_at"].dtype) == str(people["withdrawn_at"].dtype) == "datetime64[us, UTC]"
    assert people["completed_at"].iat[1] == pd.Timestamp("2031-03-01T10:01:00Z")
    assert people["withdrawn_at"].isna().all()
    assert found.described.wordings == {item: f"How {item}?" for item in ITEMS}
    assert found.declarations[0].study.name == "sakai2021"
    assert found.notes == ()


def test_the_golden_files_are_read() -> None:
    found = read_dataset(GOLDEN)
    assert len(found.tables["answers"]) == 24
    assert found.tables["decisions"]["from"].iat[3] == 'researcher, -3 years\r\nof "dreams"'
    assert read_dataset(GOLDEN / "ratings.csv").tables.keys() == {"ratings"}


def test_columns_that_nobody_knows_are_left_out_and_named(tmp_path: Path) -> None:
    data = tables()
    for row in data["ratings"]:
        row.update(mood="good", place="Bonn")
    found = read(data, tmp_path)
    assert "ratings.csv: left out the columns 'mood', 'place'." in found.notes
    assert "mood" not in found.tables["ratings"]


def test_ratings_alone_are_enough_and_columns_that_say_whose_they_are_may_be_missing(tmp_path: Path) -> None:
    needed = ("participant", "experiment", "trial", "layout", "kind", "item", "rating")
    data = {"ratings": [{name: row[name] for name in needed} for row in tables()["ratings"]]}
    found = read(data, tmp_path)
    ratings = found.tables["ratings"]
    assert set(ratings["mode"]) == {"live"}
    assert set(ratings["study"]) == set(ratings["study_version"]) == {""}
    assert "No table has a column 'mode'; all rows are taken for those of participants." in found.notes
    assert ratings["response_time_ms"].isna().all()


def test_a_table_that_does_not_say_whose_it_is_belongs_to_what_the_others_say_if_that_is_one(tmp_path: Path) -> None:
    data = tables(mode="bot")
    drop("quality", "mode")(data)
    data["quality"] = [{name: value for name, value in flag("person0", "incomplete").items() if name != "mode"}]
    assert set(read(data, tmp_path / "one").tables["quality"]["mode"]) == {"bot"}
    more = tables(("other",), mode="test")
    both = {name: [*rows, *more[name]] for name, rows in data.items()}
    (problem,) = problems_of(write_plain(tmp_path / "two", both))
    assert problem == "quality.csv: has no column 'mode', and the others hold bot, test; add it"


@pytest.mark.parametrize(("points", "is_told"), [(7, False), (5, True)])
def test_the_points_of_a_scale_are_those_of_the_study_file(points: int, is_told: bool, tmp_path: Path) -> None:
    data = tables()
    data["ratings"][0]["rating"] = "7"
    study = STUDY_FILE.read_text(encoding="utf-8").replace("points = 5", f"points = {points}", 1)
    write_exported(tmp_path, data, study.encode())
    if is_told:
        assert problems_of(tmp_path)[0].endswith("line 2, rating: is '7'; use a whole number from 1 to 5")
    else:
        assert read_dataset(tmp_path).tables["ratings"]["rating"].max() == 7


@pytest.mark.parametrize(
    ("column", "value", "problem"),
    [
        ("item", "beauty", "item: is 'beauty'; the study file does not ask it in experiment '1'"),
        ("kind", "none", "kind: is 'none'; the kinds of experiment '1' in the study file are full, subgoals, random"),
    ],
)
def test_what_the_study_file_does_not_have_is_told(column: str, value: str, problem: str, tmp_path: Path) -> None:
    data = tables()
    for row in data["ratings"]:
        if row["experiment"] == "1" and row["trial"] == "1" and (column == "kind" or row["item"] == "general"):
            row[column] = value
    told = problems_of(write_exported(tmp_path, data, STUDY_FILE.read_bytes()))
    assert len(told) == 1
    assert told[0].endswith(problem)


def test_a_file_that_was_changed_after_the_export_is_refused_or_noted(tmp_path: Path) -> None:
    name = "data/description-ratings_data.csv"
    write_exported(tmp_path, tables(), STUDY_FILE.read_bytes())
    file = tmp_path / name
    file.write_bytes(file.read_bytes().replace(b",5,", b",4,"))
    (problem,) = problems_of(tmp_path)
    assert problem.startswith(f"{name}: was changed after the export: its SHA-256 is ")
    assert problem.endswith("; take the data set as it was exported; if the change is meant, say --changed-data-ok")
    found = read_dataset(tmp_path, changed_ok=True)
    assert any(note.startswith(f"{name} was changed after the export") for note in found.notes)
    (tmp_path / "manifest.json").unlink()
    assert read_dataset(tmp_path).notes[0].startswith("There is no manifest.json")


@pytest.mark.parametrize(
    "name", ["data/description-participants_data.csv", f"studies/sakai2021-{VERSION[:12]}/study.toml"]
)
def test_a_file_that_was_removed_after_the_export_is_missed(name: str, tmp_path: Path) -> None:
    write_exported(tmp_path, tables(), STUDY_FILE.read_bytes())
    (tmp_path / name).unlink()
    (problem,) = problems_of(tmp_path)
    assert problem.startswith(f"{name}: is missing, and the manifest has it")


def test_a_table_that_was_added_after_the_export_is_refused(tmp_path: Path) -> None:
    write_exported(tmp_path, tables())
    (tmp_path / "data" / "description-quality_data.csv").write_text(text_of([flag("person0", "incomplete")]))
    (problem,) = problems_of(tmp_path)
    assert "is not in the manifest, so it was added after the export" in problem
    files = read_dataset(tmp_path, changed_ok=True).files
    assert (files.added, files.missing, files.changed) == (("data/description-quality_data.csv",), (), ())


def test_how_the_files_differ_from_the_manifest_is_told_by_their_names(tmp_path: Path) -> None:
    write_exported(tmp_path, tables(), STUDY_FILE.read_bytes())
    data = tmp_path / "data"
    assert read_dataset(tmp_path).files == DataFiles(
        {name: f"data/description-{name}_data.csv" for name in FORMS}, has_manifest=True
    )
    (data / "description-ratings_data.csv").write_bytes(text_of(tables()["ratings"][:-3]).encode())
    (data / "description-allocation_data.csv").unlink()
    shutil.rmtree(tmp_path / "studies")
    assert len(problems_of(tmp_path)) == 3
    files = read_dataset(tmp_path, changed_ok=True).files
    assert files.has_manifest
    assert files.changed == ("data/description-ratings_data.csv",)
    assert files.missing == (
        "data/description-allocation_data.csv",
        f"studies/sakai2021-{VERSION[:12]}/study.toml",
    )
    assert select(read_dataset(tmp_path, changed_ok=True)).files == files
    (tmp_path / "manifest.json").unlink()
    files = read_dataset(tmp_path).files
    assert (files.has_manifest, files.missing, files.changed) == (False, (), ())


@pytest.mark.parametrize(("changed_ok", "told"), [(False, "is missing, and the manifest"), (True, "without ratings")])
def test_ratings_that_were_removed_are_missed_in_a_line(changed_ok: bool, told: str, tmp_path: Path) -> None:
    name = "data/description-ratings_data.csv"
    write_exported(tmp_path, tables(), STUDY_FILE.read_bytes())
    (tmp_path / name).unlink()
    (problem,) = problems_of(tmp_path, changed_ok=changed_ok)
    assert problem.startswith(f"{name}: is missing")
    assert told in problem


def test_whole_numbers_are_read_as_other_programs_write_them(tmp_path: Path) -> None:
    data = tables()
    plain = read(data, tmp_path / "plain").tables["ratings"]
    for row in data["ratings"]:
        row.update(rating=f"{row['rating']}.0", trial=f"{row['trial']}.000")
        row["response_time_ms"] += ".0" if row["response_time_ms"] else ""
    pd.testing.assert_frame_equal(read(data, tmp_path / "decimal").tables["ratings"], plain)


def test_a_blank_row_of_a_spreadsheet_is_one_problem(tmp_path: Path) -> None:
    rows = tables()["ratings"]
    rows.insert(2, dict.fromkeys(rows[0], ""))
    rows[4]["rating"] = ""
    assert after(text_of(rows).encode(), tmp_path) == ["ratings.csv, line 4: is blank; delete it"]
    rows.pop(2)
    (problem,) = after(text_of(rows).encode(), tmp_path)
    assert problem.startswith("ratings.csv, line 5, rating: is empty")


@pytest.mark.parametrize(
    ("manifest", "problem"),
    [
        (b"{", "manifest.json: is no manifest of a data set; take the one of the export, or remove it"),
        (b"[" * 100_000, "manifest.json: is no manifest"),
        (b'{"format": 1, "files": {"a": 3}}', "manifest.json: is no manifest"),
        (b'{"format": 2, "files": {}}', "manifest.json: has the format 2, and this program reads 1; export the data"),
    ],
)
def test_a_manifest_that_is_none_is_refused(manifest: bytes, problem: str, tmp_path: Path) -> None:
    write_plain(tmp_path, tables())
    (tmp_path / "manifest.json").write_bytes(manifest)
    assert problems_of(tmp_path)[0].startswith(problem)


def test_a_study_file_that_cannot_be_used_is_told_with_its_lines(tmp_path: Path) -> None:
    study = STUDY_FILE.read_bytes().replace(b"seed = 2021", b"seed = 20.21")
    told = problems_of(write_exported(tmp_path, tables(), study))
    assert told[0].startswith(
        f"studies/sakai2021-{VERSION[:12]}/study.toml, line 9: seed: is 20.21; use a whole number"
    )


def test_a_plan_in_words_is_read_with_its_study_file(tmp_path: Path) -> None:
    write_plain(tmp_path, tables())
    study = STUDY_FILE.read_text(encoding="utf-8").replace('# plan = "analysis_plan.md"', 'plan = "my_plan.md"')
    (tmp_path / "study.toml").write_text(study, encoding="utf-8")
    (tmp_path / "my_plan.md").write_text("Ein Plan: größer.\n", encoding="utf-8")
    declaration = read_dataset(tmp_path).declaration("sakai2021", VERSION)
    assert declaration is not None
    assert declaration.plan == "Ein Plan: größer.\n"
    assert read_dataset(tmp_path).declaration("another", VERSION) is None


def test_what_is_no_data_set_is_told(tmp_path: Path) -> None:
    (missing,) = problems_of(tmp_path / "nowhere")
    assert missing.endswith("nowhere: is not there; name a folder that `xar export` wrote, or a file of ratings")
    (empty,) = problems_of(tmp_path)
    assert empty.endswith(": holds no ratings: neither data/description-ratings_data.csv nor ratings.csv")
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("x", "y")
    (tmp_path / "data.zip").write_bytes(file.getvalue())
    (packed,) = problems_of(tmp_path / "data.zip")
    assert packed.endswith("data.zip: is an archive; unpack it, and name the folder")
    write_exported(tmp_path / "out", tables())
    (within,) = problems_of(tmp_path / "out" / "data")
    assert within.endswith("nor ratings.csv; name the folder above it")
    (tmp_path / "ratings.csv").mkdir()
    assert problems_of(tmp_path) == ["ratings.csv: is no file"]


def test_a_file_too_large_to_be_ratings_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_plain(tmp_path, tables())
    with (tmp_path / "ratings.csv").open("r+b") as file:
        file.truncate(3_000_000_000)
    (problem, *_) = problems_of(tmp_path)
    assert problem == "ratings.csv: has 3.0 GB, and no study has more than 2 GB; is it the right file?"
    monkeypatch.setattr(read_folder, "MOST_BYTES", 10)
    assert "participants.csv: has 0.0 GB" in "".join(problems_of(tmp_path))


def test_ratings_of_thousands_are_read_at_once(tmp_path: Path) -> None:
    data = tables(tuple(f"p{number}" for number in range(700)))
    assert len(read(data, tmp_path).tables["ratings"]) == 700 * 15
    assert len(PEOPLE) < 700
