"""The newest revision is written down, so that a server need not read the steps to it."""

import subprocess
import sys

from webapp.storage.revisions import CURRENT, known_revisions


def test_the_newest_revision_is_the_last_of_the_steps() -> None:
    assert known_revisions()[0] == CURRENT


def test_a_server_does_not_load_what_changes_schemas() -> None:
    told = "import sys, webapp.app; print('alembic' in sys.modules)"
    finished = subprocess.run([sys.executable, "-c", told], check=True, capture_output=True, text=True)
    assert finished.stdout.strip() == "False"
