"""Disks that this program alone sees: the tests that need one start themselves once more behind a mount of its own."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.conftest import ROOT


def can_mount() -> bool:
    """Tell whether this process may mount: root may, unless a container forbids it."""
    unshare = shutil.which("unshare")
    if os.geteuid() != 0 or unshare is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        command = [unshare, "-m", "mount", "-t", "tmpfs", "tmpfs", folder]
        return subprocess.run(command, check=False, capture_output=True).returncode == 0


def behind_mount(mount: str, folder: Path, command: Sequence[str]) -> int:
    """Run a Python module where something is mounted that nobody else sees, and return its exit status.

    Args:
        mount: The command of the shell; `"$0"` in it is the folder.
        folder: Where to mount.
        command: The module's name and its arguments.
    """
    unshare = shutil.which("unshare")
    assert unshare is not None, "unshare was not found: apt-get install util-linux"
    words = [unshare, "-m", "sh", "-c", f'{mount} && exec "$@"', str(folder), sys.executable, "-m", *command]
    return subprocess.run(words, cwd=ROOT, check=False).returncode
