"""The copy for spreadsheets and the exact file, opened by LibreOffice and by pandas."""

from pathlib import Path

import pandas as pd
import pytest

from tests.faults.spreadsheets import (
    FULL,
    SEPARATORS,
    changed,
    convert,
    find_office,
    hostile_texts,
    num_formulas,
    read,
    write,
)

TEXTS = hostile_texts(FULL)


@pytest.fixture(scope="module")
def office() -> str:
    found = find_office()
    assert found is not None, "no LibreOffice was found; .ci/install.py --spreadsheet installs it or says how"
    return found


@pytest.mark.parametrize("separator", SEPARATORS)
def test_no_text_becomes_a_formula_whatever_separates_fields(office: str, separator: str, tmp_path: Path) -> None:
    guarded, unguarded = tmp_path / "guarded.csv", tmp_path / "unguarded.csv"
    write(guarded, TEXTS, is_guarded=True)
    write(unguarded, TEXTS, is_guarded=False)
    convert(office, [guarded, unguarded], SEPARATORS[separator], tmp_path)
    assert num_formulas(guarded.with_suffix(".xlsx")) == 0
    assert num_formulas(unguarded.with_suffix(".xlsx")) > 100, "the control has none"
    if separator == "comma":
        assert changed(guarded.with_suffix(".xlsx"), TEXTS) == []


def test_numbers_stay_numbers_and_the_mark_tells_the_encoding(office: str, tmp_path: Path) -> None:
    write(tmp_path / "table.csv", ["Zo\u00eb", "\u05e9", "=1", "'=1"], is_guarded=True)
    convert(office, [tmp_path / "table.csv"], SEPARATORS["comma"], tmp_path)
    header, *rows = read(tmp_path / "table.xlsx")
    assert [cell.value for cell in header] == ["code", "text", "minus"]
    assert [cells[1].value for cells in rows] == ["Zo\u00eb", "\u05e9", "'=1", "'=1"]
    assert [(cells[2].value, cells[2].is_text) for cells in rows] == [(str(-n), False) for n in range(1, 5)]


def test_pandas_reads_the_exact_file_back_to_the_character(tmp_path: Path) -> None:
    write(tmp_path / "table.csv", TEXTS, is_guarded=False)
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        frame = pd.read_csv(file, dtype=str, keep_default_na=False)
    assert frame["text"].tolist() == TEXTS
