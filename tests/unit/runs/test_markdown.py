import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.runs.markdown import table


def cells_of(line: str) -> list[str]:
    """Read a line as Markdown does: a vertical bar ends a cell unless a backslash stands before it."""
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def test_a_table_has_a_heading_a_rule_and_a_line_for_each_row() -> None:
    assert table(["step", "action"], [["7", "pickup"], ["14", "toggle"]]).splitlines() == [
        "| step | action |",
        "| ---- | ------ |",
        "| 7    | pickup |",
        "| 14   | toggle |",
    ]


def test_a_table_without_rows_still_has_its_headings() -> None:
    assert table(["a", "b"], []) == "| a   | b   |\n| --- | --- |\n"


def test_bars_and_line_breaks_in_a_cell_do_not_end_it() -> None:
    text = table(["|x|", "y"], [["a|b", "one\ntwo"]])
    assert [cells_of(line) for line in text.splitlines()][::2] == [["|x|", "y"], ["a|b", "one two"]]


def test_wide_letters_count_twice_so_that_columns_line_up_in_a_terminal() -> None:
    lines = table(["word", "n"], [["鍵", "1"], ["key", "2"]]).splitlines()
    assert lines[2] == "| 鍵   | 1   |"
    assert lines[3] == "| key  | 2   |"


WORDS = st.text(st.characters(codec="ascii", exclude_characters="\\", min_codepoint=32, max_codepoint=126), max_size=12)


@given(st.integers(1, 4).flatmap(lambda width: st.lists(st.lists(WORDS, min_size=width, max_size=width), min_size=1)))
def test_every_cell_can_be_read_back_and_all_lines_are_equally_long(rows: list[list[str]]) -> None:
    lines = table(rows[0], rows[1:]).splitlines()
    assert len({len(line) for line in lines}) == 1
    read = [cells_of(line) for line in (lines[0], *lines[2:])]
    assert read == [[" ".join(cell.split()) for cell in row] for row in rows]


def test_a_row_with_a_cell_too_few_is_refused_by_its_content() -> None:
    with pytest.raises(ValueError, match=r"2 headings need rows of as many cells, not \['only'\]"):
        table(["a", "b"], [["only"]])


def test_a_table_without_columns_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one heading"):
        table([], [])
