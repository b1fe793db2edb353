"""Ask for every page of the dashboard with ten thousand participants in the database.

python -m tests.benchmarks.dashboard_pages

Over Flask's test client, as an owner who sees the arms: the first request after the start and the median of five more.
What a person starts by a button and waits for - the whole data set, the proofs - is told beside it and has no limit.
"""

import json
import statistics
import sys
import tempfile
import time
from datetime import timedelta
from pathlib import Path

from tests.benchmarks.crowd import BETWEEN_ARRIVALS, START, write_crowd
from tests.unit.storage.histories import EVERY_RULE
from tests.unit.storage.people import STUDY
from tests.web.bundles import FILLED_IN, write_bundle
from tests.web.people import Visitor
from tests.web.researchers import researcher_of, unblind
from webapp.app import create_app
from webapp.config import Config
from webapp.storage.database import open_database
from webapp.storage.scope import Scope
from webapp.views.services import services_of

NUM_PEOPLE = 10_000
LIMIT_MS = 300.0
PAGES = {
    "overview": "/researcher/",
    "status": "/researcher/status.json",
    "people": "/researcher/people",
    "people, flagged": "/researcher/people?flagged=yes",
    "people, page 90": "/researcher/people?page=90",
    "allocation": "/researcher/allocation",
    "quality": "/researcher/quality",
    "results": "/researcher/results",
    "data": "/researcher/data",
    "records": "/researcher/records",
    "study": "/researcher/study",
    "preview": "/researcher/preview",
    "accounts": "/researcher/accounts",
}
SLOW = {"flow of participants": "/researcher/consort.svg", "the whole data set": "/researcher/dataset.zip"}


def main() -> int:
    """Print a table of what was measured and what may be, and return 0 if every page keeps the limit."""
    with tempfile.TemporaryDirectory() as folder:
        instance = Path(folder) / "instance"
        study = STUDY.model_copy(update={"quality": EVERY_RULE, **FILLED_IN})
        scope = Scope(study.name, write_bundle(instance, study), "live")
        with open_database(instance / "xar.sqlite3") as database:
            write_crowd(database, study, scope, NUM_PEOPLE)
        now = START + NUM_PEOPLE * BETWEEN_ARRIVALS + timedelta(minutes=1)
        began = time.perf_counter()
        app = create_app(Config(instance, study=study.name, live=True), clock=lambda: now)
        print(f"Start of the app: {time.perf_counter() - began:.1f} s; {NUM_PEOPLE:,} participants, {study.name}")
        try:
            researcher = researcher_of(app)
            unblind(researcher)
            people = json.loads(researcher.get("/researcher/people.json").text)
            person = people["participants"][0]["code"]
            return _measure(researcher, PAGES | {"a person": f"/researcher/people/{person}"})
        finally:
            services_of(app).database.close()


def _measure(researcher: Visitor, addresses: dict[str, str]) -> int:
    status = 0
    print(f"{'page':22} | first, ms | median, ms | at most")
    for name, address in addresses.items():
        first, *others = (_milliseconds(researcher, address) for _ in range(6))
        is_kept = first <= LIMIT_MS and statistics.median(others) <= LIMIT_MS
        status = status if is_kept else 1
        verdict = "kept" if is_kept else "BROKEN"
        print(f"{name:22} | {first:9.1f} | {statistics.median(others):10.1f} | {LIMIT_MS:.0f}  {verdict}")
    for name, address in SLOW.items():
        print(f"{name:22} | {_milliseconds(researcher, address):9.1f} |")
    for name, address in {"replay": "/researcher/allocation/replay", "verify": "/researcher/records/verify"}.items():
        began = time.perf_counter()
        assert researcher.post(address).status_code == 200, name
        print(f"{name:22} | {1000 * (time.perf_counter() - began):9.1f} |")
    return status


def _milliseconds(researcher: Visitor, address: str) -> float:
    began = time.perf_counter()
    answer = researcher.get(address)
    taken = 1000 * (time.perf_counter() - began)
    assert answer.status_code == 200, f"{address}: {answer.status}"
    return taken


if __name__ == "__main__":
    sys.exit(main())
