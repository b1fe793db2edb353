"""A real server on a temporary instance, as a researcher would run it."""

import csv
import io
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.web.servers import run, serving
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.storage.database import open_database
from webapp.storage.exports import FileName, write_csv
from webapp.study.texts import Texts

STUDY = "sakai2021"
RESEARCHER = "researcher"

Row = dict[str, str]


@dataclass(frozen=True, slots=True)
class Site:
    """A running server.

    Attributes:
        address: Without a slash at the end.
        instance: Its instance folder.
        password: The researcher's.
        catalogue: What it shows.
    """

    address: str
    instance: Path
    password: str
    catalogue: Catalogue

    @property
    def texts(self) -> Texts:
        """What participants read."""
        return self.catalogue.texts("en")

    def export(self, name: FileName) -> list[Row]:
        """Return the rows that a file of the data has at this moment."""
        content = io.BytesIO()
        with open_database(self.instance / "xar.sqlite3", make=False) as database, database.read() as connection:
            write_csv(connection, name, content)
        return read_csv(content.getvalue())

    def export_by_command(self, folder: Path) -> None:
        """Write the files of the data with the command line."""
        finished = run(self.instance, "export", str(folder))
        assert finished.returncode == 0, finished.stderr


def read_csv(content: bytes) -> list[Row]:
    return list(csv.DictReader(io.StringIO(content.decode("utf-8"), newline="")))


_REFUSED_SIGN_IN = '"message": "a sign-in failed"'
"""What a server says of a wrong password: an event that is logged, and no complaint."""


@contextmanager
def serve(built_instance: Path, instance: Path, study: str = STUDY) -> Iterator[Site]:
    """Serve a copy of a built study; a server that complains or does not stop cleanly fails whoever used it."""
    shutil.copytree(built_instance / "bundles", instance / "bundles")
    made = run(instance, "admin", "create", RESEARCHER, "--generate-password")
    assert made.returncode == 0, made.stderr
    catalogue = Catalogue.open(current_bundle(instance, study))
    with serving(instance, "--study", study) as server:
        yield Site(f"http://127.0.0.1:{server.port}", instance, made.stdout.split()[-1], catalogue)
        status, complaints = server.stop(signal.SIGINT)
    unexpected = [line for line in complaints.splitlines() if _REFUSED_SIGN_IN not in line]
    assert (status, unexpected) == (0, []), complaints
