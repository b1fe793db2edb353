"""What is stored of one participant's pages, as entries to compare with what a sender knows it sent.

Logs of events are left out: the server drops from them what makes no sense, and no answer depends on them.
"""

from collections.abc import Iterator

from sqlalchemy import Connection, Table, select

from webapp.storage.database import Database
from webapp.storage.participants import Participant
from webapp.storage.tables import answers, drive_steps, drives, pages, predictions, ratings

Entry = tuple[str, ...]
"""A stored row without whose it is, on which page and when; a time is in milliseconds, `NOT_MEASURED` without one.

`("page",)`, `("rating", item, value, time)`, `("answer", attempt, question, answer)`,
`("prediction", question, action, confidence, time)`, `("step", number, action, time)` or `("drive", end)`.
"""

NOT_MEASURED = "not measured"


def read_back(database: Database, participant: Participant) -> dict[int, list[Entry]]:
    """Return by page number what is stored of a participant, all from one state of the database."""
    found: dict[int, list[Entry]] = {}
    with database.read() as connection:
        for number, entry in _entries(connection, participant.id):
            found.setdefault(number, []).append(entry)
    return found


def _entries(connection: Connection, participant_id: int) -> Iterator[tuple[int, Entry]]:
    for row in connection.execute(select(pages.c.number).where(pages.c.participant_id == participant_id)):
        yield row.number, ("page",)
    for name, table, columns in _PARTS:
        of_page = table.c.page_number
        query = select(of_page, *(table.c[column] for column in columns)).where(
            table.c.participant_id == participant_id
        )
        for number, *values in connection.execute(query):
            yield number, (name, *(NOT_MEASURED if value is None else str(value) for value in values))


_PARTS: tuple[tuple[str, Table, tuple[str, ...]], ...] = (
    ("rating", ratings, ("item", "rating", "response_time_ms")),
    ("answer", answers, ("attempt", "question", "answer")),
    ("prediction", predictions, ("question", "predicted", "confidence", "response_time_ms")),
    ("step", drive_steps, ("number", "action", "elapsed_ms")),
    ("drive", drives, ("end",)),
)
