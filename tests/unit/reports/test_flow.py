"""The flow of participants in a report: the numbers of the tables, drawn and told."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.reports.data_sets import STUDY_FILE, Tables, decision, flag, tables, write_exported, write_plain
from tests.unit.storage.exported import LATER, take_part, wanted_of
from webapp.reports.blocks import Drawing, Section, Statement, Table
from webapp.reports.flow import flow_of, section
from webapp.reports.reading import read_dataset
from webapp.reports.selection import Selection, Wishes, select
from webapp.storage.consort import read_flows
from webapp.storage.database import Database, open_database
from webapp.storage.dataset import export

LATE = "2031-03-01T12:00:00.000000Z"
RULES = b"[quality]\nstraight_lining = true\n\n[consent]"


@pytest.fixture
def data() -> Tables:
    """Six people: one left, one is flagged, one excluded, three are analysed; another was erased."""
    data = tables()
    data["participants"][0].update(completed_at="", withdrawn_at=LATE)
    data["quality"] = [flag("person1", "straight_lining"), flag("person2", "straight_lining", flagged=False)]
    data["participants"][2]["excluded_at"] = LATE
    erased = dict(data["allocation"][0]) | {"participant": "", "record": "99"}
    data["allocation"] += [erased, erased | {"experiment": "2"}]
    place = {"page": "3", "file": "ratings", "question": "general", "from": "2"}
    data["decisions"] = [decision("person3", "corrected", 1, **place, to="5")]
    return data


def selected(data: Tables, folder: Path, wishes: Wishes | None = None) -> Selection:
    study = STUDY_FILE.read_bytes().replace(b"[consent]", RULES, 1)
    return select(read_dataset(write_exported(folder, data, study)), wishes=wishes)


def table(made: Section, name: str) -> dict[object, tuple[object, ...]]:
    (found,) = (block for block in made.blocks if isinstance(block, Table) and block.name == name)
    return {row[:2] if name == "flow" else row[0]: row[1:] for row in found.rows}


def test_the_numbers_add_up_from_the_consent_to_who_is_analysed(data: Tables, tmp_path: Path) -> None:
    found = selected(data, tmp_path)
    steps = table(section(found.data, found), "flow")
    assert {key: row[-1] for key, row in steps.items()} == {
        ("agreed and allocated", None): 6,
        ("left the study", None): 1,
        ("screened out by the quiz", None): 0,
        ("began and did not finish", None): 0,
        ("completed", None): 5,
        ("excluded after completing", None): 2,
        ("excluded after completing", "excluded by a researcher"): 1,
        ("excluded after completing", "gave every item of every trial the same rating"): 1,
        ("analysed", None): 3,
    }
    assert len(found.data.participants) == 3


def test_the_drawing_says_the_same_and_can_be_read_by_programs(data: Tables, tmp_path: Path) -> None:
    found = selected(data, tmp_path)
    (drawing,) = (block for block in section(found.data, found).blocks if isinstance(block, Drawing))
    texts = " ".join("".join(text.itertext()) for text in ET.fromstring(drawing.svg).iter())  # noqa: S314 - we drew it.
    for told in (
        "Agreed and allocated (n = 6)",
        "Analysed (n = 3)",
        "erased at their own wish",
        "0/0: full · subgoals",
    ):
        assert told in texts.replace("\N{NO-BREAK SPACE}", " ")
    assert "1 were erased at their own wish" in drawing.alt


def test_kinds_and_arrangements_are_counted_as_they_were_drawn(data: Tables, tmp_path: Path) -> None:
    found = selected(data, tmp_path)
    flow = flow_of(found.data, found.allocation)
    assert flow is not None
    assert {key: counts.allocated for key, counts in flow.kinds.items()} == {
        ("1", "full"): 6,
        ("1", "subgoals"): 6,
        ("1", "random"): 6,
        ("2", "all_key_points"): 6,
        ("2", "first_key_point"): 6,
    }
    assert {key: counts.analysed for key, counts in flow.arrangements.items()} == {
        ("1", 0, 0): 1,
        ("1", 1, 0): 1,
        ("1", 2, 0): 1,
        ("2", 0, 0): 1,
        ("2", 1, 0): 2,
    }
    assert flow.num_erased == 1


def test_rules_corrections_and_notes_are_told(data: Tables, tmp_path: Path) -> None:
    found = selected(data, tmp_path)
    made = section(found.data, found)
    assert table(made, "exclusion_rules") == {
        "straight_lining": ("gave every item of every trial the same rating", 1, 1)
    }
    assert table(made, "corrections") == {"person3": ("ratings", "general", "2", "5", "typed wrongly")}
    assert set(found.notes) < {block for block in made.blocks if isinstance(block, str)}


def test_the_incomplete_are_told_where_they_are_analysed_too(data: Tables, tmp_path: Path) -> None:
    found = selected(data, tmp_path, Wishes(include_incomplete=True))
    sentence = section(found.data, found).blocks[0]
    assert isinstance(sentence, str)
    assert "which leaves 3. With 1 who did not complete it, 4 are analysed." in sentence


def test_the_flow_ends_in_who_is_analysed_also_with_the_incomplete(data: Tables, tmp_path: Path) -> None:
    data["participants"][4].update(completed_at="", withdrawn_at=LATE)
    data["ratings"] = [row for row in data["ratings"] if row["participant"] != "person4"]
    found = selected(data, tmp_path, Wishes(include_incomplete=True))
    made = section(found.data, found)
    steps = table(made, "flow")
    assert steps["did not complete and analysed all the same", None][-1] == 1
    assert steps["analysed", None][-1] == len(found.data.participants) == 3
    (drawing,) = (block for block in made.blocks if isinstance(block, Drawing))
    for told in ("Analysed (n = 3)", "with those who did not complete (n = 1)", "3 are analysed, with 1 who"):
        assert told in drawing.svg
    assert "of these, analysed all the same (n\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}1)" in drawing.svg
    assert [row[-1] for row in table(made, "flow_by_kind").values()] == [3] * 2


def test_without_participants_there_is_a_statement_and_no_number(tmp_path: Path) -> None:
    found = select(read_dataset(write_plain(tmp_path, {"ratings": tables()["ratings"]})))
    made = section(found.data)
    assert made.blocks == (
        Statement(
            "The flow of participants",
            "the data set has no participants.csv; 6 participants with 90 ratings are analysed",
        ),
    )


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    with open_database(tmp_path / "instance" / "xar.sqlite3"):
        pass
    opened = Database(tmp_path / "instance" / "xar.sqlite3")
    yield opened
    opened.close()


def test_a_real_export_has_the_flow_that_the_database_has(database: Database, tmp_path: Path) -> None:
    take_part(database)
    export(database, tmp_path / "out", wanted_of(database), LATER)
    found = select(read_dataset(tmp_path / "out"), wishes=Wishes(apply_rules=False))
    with database.read() as connection:
        (stored,) = read_flows(connection, wanted_of(database))
    flow = flow_of(found.data, found.allocation)
    assert flow is not None
    told = flow.as_json()
    kept = stored.as_json()
    for counts in (told, kept):
        # The database has the researchers' own words for the reasons.
        _without_reasons(counts)
    assert told == kept


def _without_reasons(counts: object) -> None:
    if isinstance(counts, dict):
        if isinstance(counts.get("excluded"), dict):
            counts["excluded"] = sum(counts["excluded"].values())
        for part in counts.values():
            _without_reasons(part)
    elif isinstance(counts, list):
        for part in counts:
            _without_reasons(part)
