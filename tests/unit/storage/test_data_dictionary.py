import re
from pathlib import Path

import pytest

from webapp.storage.consort import CONSORT
from webapp.storage.export_columns import WIDE_WHO, names
from webapp.storage.exports import COLUMNS as COLUMNS_OF_FILES
from webapp.storage.exports import FILE_NAMES, RECRUITS
from webapp.storage.schema import metadata
from webapp.storage.wide_rows import trial_columns
from webapp.study.events import BEHAVIOUR_EVENTS, EVENTS, MAX_EVENTS

DICTIONARY = Path(__file__).parents[3] / "docs" / "data-dictionary.md"
COLUMNS: dict[str, tuple[str, ...]] = {
    **{name: names(variables) for name, variables in COLUMNS_OF_FILES.items()},
    "consort.csv": names(CONSORT),
    **{f"Table {table.name}": tuple(table.columns.keys()) for table in metadata.sorted_tables},
}


@pytest.mark.parametrize("title", COLUMNS)
def test_every_column_is_described_in_order_and_nothing_else(title: str) -> None:
    described = rows_of(title)
    assert tuple(name for name, *_ in described) == COLUMNS[title]
    assert all(cell.strip() for row in described for cell in row)


def test_every_section_is_about_something_that_is_there() -> None:
    titles = re.findall(r"^##+ `?([^`\n]+)`?$", DICTIONARY.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert set(COLUMNS) <= set(titles)
    of_studies = {title for title in titles if not title.startswith("simulations/")}
    assert {title for title in of_studies if title.startswith("Table ") or title.endswith(".csv")} == {
        *COLUMNS,
        "wide.csv",
    }
    assert {*COLUMNS, "wide.csv"} >= {*FILE_NAMES, RECRUITS}


def test_every_event_is_described_and_those_of_looking_under_the_section_that_declares_them() -> None:
    log, looking = section("events.csv").split("[behaviour_log]")
    described = [re.findall(r"^- ((?:`\w+`(?:, )?)+):", part, flags=re.MULTILINE) for part in (log, looking)]
    timing, behaviour = ({name for names in part for name in re.findall(r"\w+", names)} for part in described)
    assert timing == EVENTS - BEHAVIOUR_EVENTS | {"drive_action"}
    assert behaviour == BEHAVIOUR_EVENTS
    assert f"at most {MAX_EVENTS} events" in log


def test_every_column_of_the_wide_file_is_described_and_nothing_else() -> None:
    patterns = re.findall(r"^\| `([^`]+)` \|", section("wide.csv"), flags=re.MULTILINE)
    assert tuple(patterns[: len(WIDE_WHO)]) == names(WIDE_WHO)
    written = {pattern.replace("TRIAL", "1.2") for pattern in patterns[len(WIDE_WHO) :]}
    made = {
        *(variable.name.replace("ease", "ITEM") for variable in trial_columns("1.2", ["ease"])),
        "background.QUESTION",
    }
    assert written == made


def rows_of(title: str) -> list[tuple[str, ...]]:
    """The rows of the table under a heading: first the column's name, then what is said of it."""
    lines = re.findall(r"^\| `(\w+)` \|(.+)\|$", section(title), flags=re.MULTILINE)
    return [(name, *rest.split("|")) for name, rest in lines]


def section(title: str) -> str:
    text = DICTIONARY.read_text(encoding="utf-8")
    found = re.search(rf"^##+ `?{re.escape(title)}`?$(.*?)(?=^##|\Z)", text, flags=re.MULTILINE | re.DOTALL)
    assert found is not None, title
    return found[1]
