"""What is wrong with the rows of a table, gathered so that it can be told by line."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from webapp.reports.read_problems import MOST_TOLD, first_of, shown
from webapp.reports.read_text import RawTable


@dataclass(slots=True)
class Faults:
    """The problems of one table.

    Attributes:
        table: The table.
    """

    table: RawTable
    _of_table: list[str] = field(default_factory=list)
    _of_rows: list[tuple[int, str, int | None]] = field(default_factory=list)
    _num_more: int = 0

    def __bool__(self) -> bool:
        return bool(self._of_table or self._of_rows)

    def of_table(self, message: str) -> None:
        """Note what is wrong with the table as a whole."""
        self._of_table.append(message)

    def of_cells(self, rows: Sequence[int], column: str, wish: str) -> None:
        """Note cells that hold something else than what is wanted, by the ascending places of their rows from 0."""
        cells = self.table.cells[column]
        for row in self.first(rows):
            found = "is empty" if cells.iat[row] == "" else f"is {shown(str(cells.iat[row]))}"
            self._of_rows.append((row, f", {column}: {found}; {wish}", None))

    def first(self, rows: Sequence[int]) -> Sequence[int]:
        """Return those of some rows, ascending, that can be told, and count the others."""
        self._num_more += max(0, len(rows) - MOST_TOLD)
        return [int(row) for row in rows[:MOST_TOLD]]

    def of_row(self, row: int, message: str, other: int | None = None) -> None:
        """Note a row; `{line}` in the message stands for the line of the other one."""
        self._of_rows.append((row, f": {message}", other))

    def told(self) -> tuple[str, ...]:
        """Return a line for each problem, those of rows by their place in the file."""
        file = self.table.file
        rows = sorted(self._of_rows, key=lambda fault: fault[0])[:MOST_TOLD]
        lines = dict(zip(places := sorted(_places(rows)), self.table.lines(places), strict=True))
        told = [f"{file}: {message}" for message in self._of_table]
        for row, message, other in rows:
            said = message if other is None else message.replace("{line}", f"line {lines[other]}")
            told.append(f"{file}, line {lines[row]}{said}")
        return first_of(told, file, len(self._of_table) + len(self._of_rows) + self._num_more)


def _places(rows: Sequence[tuple[int, str, int | None]]) -> set[int]:
    return {place for row, _, other in rows for place in (row, other) if place is not None}
