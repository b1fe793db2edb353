"""What `xar doctor` says of the machine and the settings, without an instance."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from webapp.storage.surroundings import disk, place, settings_findings


@pytest.mark.parametrize(
    ("kind", "status"),
    [
        *((kind, "problem") for kind in ("nfs4", "cifs", "smb3", "fuse.sshfs", "9p", "virtiofs", "tmpfs")),
        *((kind, "ok") for kind in ("ext4", "xfs", "btrfs", "zfs")),
        ("overlay", "warning"),
    ],
)
def test_file_systems_that_cannot_be_relied_on_are_named(tmp_path: Path, kind: str, status: str) -> None:
    mounts = tmp_path / "mounts"
    mounts.write_text(f"proc /proc proc rw 0 0\ndisk / ext4 rw 0 0\nother {tmp_path} {kind} rw 0 0\n")
    assert {finding.status for finding in place(tmp_path, mounts)} == {status}
    assert {finding.status for finding in place(Path("/"), mounts)} == {"ok"}


@pytest.mark.parametrize("name", ["Dropbox", "OneDrive - University", "Mobile Documents", "Google Drive", "Nextcloud"])
def test_synchronised_folders_are_named(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name / "study"
    folder.mkdir(parents=True)
    mounts = tmp_path / "mounts"
    mounts.write_text("disk / ext4 rw 0 0\n")
    assert [finding.status for finding in place(folder, mounts)] == ["problem"]


@pytest.mark.parametrize(("free", "status"), [(499, "problem"), (501, "warning"), (1999, "warning"), (2001, "ok")])
def test_little_room_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free: int, status: str) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=free * 10**6)
    monkeypatch.setattr(shutil, "disk_usage", lambda _folder: usage)
    assert disk(tmp_path).status == status


@pytest.mark.parametrize(
    ("settings", "statuses"),
    [
        ({"host": "127.0.0.1", "is_local": True, "https": False, "trusted_hosts": ("localhost",)}, ["ok"]),
        ({"host": "0.0.0.0", "is_local": False, "https": True, "trusted_hosts": ("x.example",)}, ["ok"]),  # noqa: S104
        ({"host": "0.0.0.0", "is_local": False, "https": False, "trusted_hosts": ()}, ["problem", "warning"]),  # noqa: S104
    ],
)
def test_settings_that_let_others_read_along_are_told(settings: dict[str, Any], statuses: list[str]) -> None:
    assert [finding.status for finding in settings_findings(**settings)] == statuses


def test_debugging_where_people_take_part_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLASK_DEBUG", "1")
    found = settings_findings(host="127.0.0.1", is_local=True, https=False, trusted_hosts=("localhost",))
    assert [(finding.status, finding.told) for finding in found] == [("problem", "FLASK_DEBUG is set")]
