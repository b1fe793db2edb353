"""A study with some live data, and what an export of it holds."""

import csv
import io
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tests.unit.storage.people import DRIVING, enrol_somebody, walk
from tests.web.bundles import read_study, write_bundle
from webapp.storage.database import Database
from webapp.storage.people import exclude
from webapp.storage.wanted import Wanted, bundles_in
from webapp.study.recruitment import Recruit
from webapp.study.sections import Quality

LATER = datetime(2031, 4, 1, 12, tzinfo=UTC)
_RULES = Quality(straight_lining=True, incomplete=True, min_total_minutes=1.0)
_EXPERIMENT = DRIVING.experiments[0].model_copy(update={"items": read_study().experiments[0].items})
STUDY = DRIVING.model_copy(update={"quality": _RULES, "experiments": (_EXPERIMENT,)})
"""Everything around the trials; the items are those that the bundle has a wording for."""


def take_part(database: Database) -> None:
    """Three live participants of a study whose bundle is there: one has finished, one was excluded, one has begun."""
    version = write_bundle(database.path.parent, STUDY)
    for number, last in enumerate((None, None, 3)):
        recruit = Recruit("sona", f"sona{number}")
        person = enrol_somebody(database, "live", version, study=STUDY, recruit=recruit)
        walk(database, person, person.num_pages if last is None else last, rating=1 + number, study=STUDY)
        if number == 1:
            exclude(database, person.code, "took part twice", "ann", LATER)


def wanted_of(database: Database) -> Wanted:
    return Wanted(find_bundle=bundles_in(database.path.parent))


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode("utf-8-sig"), newline="")))


def texts_of(svg: bytes) -> list[str]:
    root: Any = ET.fromstring(svg.decode("utf-8"))  # noqa: S314 - we wrote it.
    return [
        "".join(element.itertext()).replace("\u00a0", " ") for element in root.iter("{http://www.w3.org/2000/svg}text")
    ]
