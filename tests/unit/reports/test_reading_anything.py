"""Whatever the bytes are: a data set is read as it was written, or refused in words."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from random import Random

import pandas as pd
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.unit.reports.data_sets import STUDY_FILE, decision, flag, tables, text_of, write_exported, write_plain
from webapp.reports.reading import DataSet, DataSetError, read_dataset
from webapp.reports.selection import Selection, select

TEXT = text_of(tables(("a", "b"))["ratings"])
TABLES = ("ratings", "participants", "allocation", "decisions", "quality")
CELLS = st.one_of(
    st.text(max_size=6),
    st.sampled_from(
        ["", "0", "6", "-1", "1.0", "1e3", "nan", "NaN", "inf", "true", "None", "9" * 25, "2031-03-01T09:30:00Z"]
    ),
)
words = st.text(st.characters(exclude_characters="\0", codec="utf-8"), min_size=1, max_size=8).filter(
    lambda word: word.strip()
)


def outcome(folder: Path, files: Mapping[str, bytes]) -> DataSet | None:
    """What is read of a folder with these files; None if it is refused, which has to be in words."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    refusal = None
    try:
        return read_dataset(folder)
    except DataSetError as error:
        refusal = error
    assert refusal.problems
    assert all(problem.strip() and "\0" not in problem for problem in refusal.problems)
    return None


def chosen(found: DataSet) -> Selection | None:
    try:
        return select(found)
    except DataSetError:
        return None


@given(st.binary(max_size=200))
@example(b"participant,experiment,trial,layout,kind,item,rating\n" + b'"' * 9)
def test_any_bytes_are_read_or_refused_in_words(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        outcome(Path(folder), {"ratings.csv": content})


@given(st.sampled_from(["study.toml", "manifest.json", "participants.csv", "decisions.csv"]), st.binary(max_size=60))
@example("study.toml", b"a = " + b"[" * 20_000)
@example("manifest.json", b"[" * 200_000)
@example("manifest.json", b'{"format": 1, "files": {"ratings.csv": null}}')
def test_any_bytes_beside_the_ratings_are_read_or_refused_in_words(name: str, content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        outcome(Path(folder), {"ratings.csv": TEXT.encode(), name: content})


@given(st.recursive(st.none() | st.integers() | st.text(max_size=4), lambda inner: st.lists(inner, max_size=2)))
def test_a_description_of_any_form_is_no_reason_to_refuse_the_data(tree: object) -> None:
    for content in (
        f'{{"variableMeasured": {tree!r}}}',
        f'{{"variableMeasured": [{{"name": "item", "x": {tree!r}}}]}}',
    ):
        with tempfile.TemporaryDirectory() as folder:
            files = {"ratings.csv": TEXT.encode(), "dataset_description.json": content.encode(errors="replace")}
            assert outcome(Path(folder), files) is not None


@given(st.data())
def test_any_edit_of_the_bytes_is_read_or_refused_in_words(data: st.DataObject) -> None:
    content = TEXT.encode()
    start = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(start, min(len(content), start + 40)))
    with tempfile.TemporaryDirectory() as folder:
        found = outcome(
            Path(folder), {"ratings.csv": content[:start] + data.draw(st.binary(max_size=8)) + content[end:]}
        )
        if found is not None:
            chosen(found)


@given(st.sampled_from(TABLES), st.data())
def test_any_edit_of_cells_is_read_or_refused_and_what_is_read_can_be_chosen(name: str, data: st.DataObject) -> None:
    spoiled = tables(("a", "b", "c"))
    place = {"page": "3", "file": "ratings", "question": "general", "from": "4"}
    spoiled["decisions"] = [decision("a", "corrected", number, **place, to=str(number)) for number in (1, 2)]
    spoiled["quality"] = [flag("b", "straight_lining"), flag("c", "incomplete", flagged=False)]
    for _ in range(data.draw(st.integers(1, 3))):
        row = data.draw(st.sampled_from(spoiled[name]))
        row[data.draw(st.sampled_from(sorted(row)))] = data.draw(CELLS)
    with tempfile.TemporaryDirectory() as folder:
        files = {f"{each}.csv": text_of(rows).encode(errors="replace") for each, rows in spoiled.items() if rows}
        if data.draw(st.booleans()):
            files["study.toml"] = STUDY_FILE.read_bytes()
        found = outcome(Path(folder), files)
        if found is not None:
            selection = chosen(found)
            assert (
                selection is None
                or not selection.data.ratings.duplicated(["participant", "experiment", "trial", "item"]).any()
            )


@given(
    people=st.lists(words, min_size=1, max_size=4, unique=True),
    kinds=st.lists(words, min_size=1, max_size=3, unique=True),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    data=st.data(),
)
def test_what_is_written_is_read_back(people: list[str], kinds: list[str], encoding: str, data: st.DataObject) -> None:
    rows = [
        {
            "participant": person,
            "experiment": "1",
            "trial": str(trial),
            "layout": f"map {trial}",
            "kind": kind,
            "item": "general",
            "rating": str(data.draw(st.integers(1, 5))),
            "response_time_ms": data.draw(st.sampled_from(["", "0", "86400000"])),
        }
        for person in people
        for trial, kind in enumerate(kinds, start=1)
    ]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "ratings.csv").write_bytes(text_of(rows).encode(encoding))
        found = read_dataset(Path(folder)).tables["ratings"]
    for column in rows[0]:
        values = ["" if pd.isna(value) else str(value) for value in found[column]]
        assert values == [row[column] for row in rows]


@settings(max_examples=15)
@given(st.randoms(use_true_random=False))
def test_the_order_of_the_rows_changes_nothing(order: Random) -> None:
    shuffled = tables(("a", "b", "c"))
    with tempfile.TemporaryDirectory() as folder:
        before = select(read_dataset(write_exported(Path(folder), shuffled, STUDY_FILE.read_bytes()))).data
    for rows in shuffled.values():
        order.shuffle(rows)
    with tempfile.TemporaryDirectory() as folder:
        after = select(read_dataset(write_exported(Path(folder), shuffled, STUDY_FILE.read_bytes()))).data
    pd.testing.assert_frame_equal(before.ratings, after.ratings)
    assert before.everybody is not None
    assert after.everybody is not None
    pd.testing.assert_frame_equal(before.everybody, after.everybody)


def test_a_whole_data_set_is_read_alike_as_it_was_exported_and_by_plain_names(tmp_path: Path) -> None:
    exported = read_dataset(write_exported(tmp_path / "exported", tables()))
    plain = read_dataset(write_plain(tmp_path / "plain", tables()))
    assert exported.tables.keys() == plain.tables.keys()
    for name, table in exported.tables.items():
        pd.testing.assert_frame_equal(table, plain.tables[name])
