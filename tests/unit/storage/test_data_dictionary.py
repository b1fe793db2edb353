import re
from pathlib import Path

import pytest

from webapp.storage.exports import PARTICIPANTS_COLUMNS, RATINGS_COLUMNS
from webapp.storage.tables import metadata

DICTIONARY = Path(__file__).parents[3] / "docs" / "data-dictionary.md"
COLUMNS = {"ratings.csv": RATINGS_COLUMNS, "participants.csv": PARTICIPANTS_COLUMNS} | {
    f"Table {table.name}": tuple(table.columns.keys()) for table in metadata.sorted_tables
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
    assert {title for title in of_studies if title.startswith("Table ") or title.endswith(".csv")} == set(COLUMNS)


def rows_of(title: str) -> list[tuple[str, ...]]:
    """The rows of the table under a heading: first the column's name, then what is said of it."""
    text = DICTIONARY.read_text(encoding="utf-8")
    section = re.search(rf"^##+ `?{re.escape(title)}`?$(.*?)(?=^##|\Z)", text, flags=re.MULTILINE | re.DOTALL)
    assert section is not None, title
    lines = re.findall(r"^\| `(\w+)` \|(.+)\|$", section[1], flags=re.MULTILINE)
    return [(name, *rest.split("|")) for name, rest in lines]
