"""A table of the report as a CSV file with all digits, in the form of the data set it comes from (RFC 4180)."""

import csv
import io

from webapp.reports.blocks import Cell, Table
from webapp.reports.formatting import plain


def csv_of(table: Table) -> bytes:
    """Return the table as UTF-8 with lines that end in CR LF; an empty field means that there is no such number."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(column.name for column in table.columns)
    writer.writerows([_field(cell) for cell in row] for row in table.rows)
    return text.getvalue().encode()


def _field(cell: Cell) -> str:
    value = plain(cell)
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)
