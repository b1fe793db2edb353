"""A copy of the tree, in which everything may be changed."""

import io
import shutil
import subprocess
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.conftest import ROOT


@contextmanager
def copy_of_the_tree() -> Iterator[Path]:
    """Copy what git knows or would take up into a folder that is gone afterwards."""
    git = shutil.which("git")
    if git is None:
        raise SystemExit("git is not on the path; it says what belongs to the tree")
    listed = subprocess.run(
        [git, "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as archive:
        for name in filter(None, listed.split("\0")):
            if (ROOT / name).exists():
                archive.add(ROOT / name, name)
    packed.seek(0)
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=packed) as archive:
            archive.extractall(folder, filter="data")
        yield Path(folder)
