"""A part of the tests again, on PostgreSQL; `make test-postgres` runs all of them there."""

import os
import subprocess
import sys
from pathlib import Path

CHOSEN = (
    "tests/unit/storage/test_enrolment.py",
    "tests/unit/storage/test_answers.py",
    "tests/unit/storage/test_records.py",
    "tests/unit/storage/test_ledger.py",
    "tests/web/test_arrivals.py",
)
# Long ones; `make test-postgres` runs them too.
LEFT_OUT = "not behind_the_programs_back and not places_stay_within_one"


def test_enrolment_answers_records_and_ledger_pass_on_postgres(root: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-k", LEFT_OUT, *CHOSEN],
        cwd=root,
        env=environment | {"XAR_TEST_POSTGRES": "1"},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert " passed" in done.stdout
