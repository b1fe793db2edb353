"""Checks of an instance that look at its folder and the machine, never into the database."""

import os
import re
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path

from webapp.storage.findings import Finding, worst

MIN_FREE_MB = 500
"""Below, a study of a few hundred participants may not end: a problem. Four times as much is no reason to worry."""
_KEY_BYTES = 32
_NETWORK = re.compile(r"nfs|cifs|smb|afs|9p|ceph|gluster|lustre|beegfs|vboxsf|fuse\.(?!fuse-overlayfs)|davfs|virtiofs")
_IN_MEMORY = frozenset({"tmpfs", "ramfs"})
_SYNCED = re.compile(
    r"dropbox|onedrive|icloud ?drive|mobile documents|com~apple~clouddocs|google ?drive|my drive|nextcloud|owncloud|"
    r"syncthing|pclouddrive|box sync",
    re.IGNORECASE,
)
_HEADER = b"SQLite format 3\x00"


def folder_findings(database: Path, *, is_served: bool, holds_answers: bool = True) -> Iterator[Finding]:
    """Check the folder of an instance and what it lies on.

    Args:
        database: The file of the SQLite edition, whether it is there or not; its folder is the instance in both.
        is_served: Whether a server runs.
        holds_answers: Whether they are in that file; if not, in PostgreSQL.
    """
    instance = database.parent
    yield disk(instance, holds_answers=holds_answers)
    yield from permissions(instance)
    yield secret_key(instance)
    yield from place(instance)
    yield from left_behind(database, is_served=is_served or not holds_answers)
    if holds_answers:
        yield holders(database)


def disk(folder: Path, *, holds_answers: bool = True) -> Finding:
    """Check that there is room."""
    free = shutil.disk_usage(folder).free // 10**6
    told = f"{free:,} MB free"
    if free < MIN_FREE_MB:
        full = "no answer can be stored" if holds_answers else "no study can be built and no backup made"
        return Finding("disk", "problem", told, f"make room: on a full disk {full}")
    if free < 4 * MIN_FREE_MB:
        return Finding("disk", "warning", told, "make room before the study begins")
    return Finding("disk", "ok", told)


def permissions(instance: Path) -> list[Finding]:
    """Check that nobody but the owner can read the instance, and that we are the owner."""
    found = []
    paths = [instance, *(path for path in instance.iterdir() if path.is_file() and not path.is_symlink())]
    for path in paths:
        status = path.stat()
        wanted = 0o700 if path == instance else 0o600
        if stat.S_IMODE(status.st_mode) & 0o077:
            mode = f"{stat.S_IMODE(status.st_mode):04o}"
            told = f"{path} can be read by others (mode {mode})"
            found.append(Finding("permissions", "problem", told, f"chmod {wanted:o} {path}"))
        if status.st_uid != os.geteuid():
            told = f"{path} belongs to user {status.st_uid}, and this is user {os.geteuid()}"
            found.append(Finding("permissions", "warning", told, "run xar as the user that serves"))
    return worst("permissions", found, f"{instance} and its {len(paths) - 1} files are the owner's alone")


def secret_key(instance: Path) -> Finding:
    """Check the key that signs cookies and nonces."""
    path = instance / "secret_key"
    if not path.exists():
        return Finding(
            "secret key", "warning", "there is none yet", "the first `xar serve` makes one; keep it with backups"
        )
    size = path.stat().st_size
    if size != _KEY_BYTES:
        told = f"{path} holds {size} bytes, not {_KEY_BYTES}"
        return Finding("secret key", "problem", told, "bring back the one that was kept, or delete it to get a new one")
    return Finding("secret key", "ok", f"{size} bytes")


def place(instance: Path, mounts: Path = Path("/proc/mounts")) -> list[Finding]:
    """Check that the instance lies on a disk of this machine, and in no folder that something else rewrites."""
    found = shared_place(instance, mounts)
    real = instance.resolve()
    kind = _file_system(real, mounts)
    if kind in _IN_MEMORY:
        told = f"{real} is in memory ({kind})"
        found.append(Finding("place", "problem", told, "all of it is lost when the machine stops; use a disk"))
    elif kind == "overlay":
        told = f"{real} is on a container's own layer"
        found.append(Finding("place", "warning", told, "it goes with the container; put it on a volume"))
    return worst("place", found, f"on a disk of this machine ({kind or 'unknown file system'})")


def shared_place(instance: Path, mounts: Path = Path("/proc/mounts")) -> list[Finding]:
    """Check that nothing but this machine writes to the instance; return what is wrong."""
    found = []
    real = instance.resolve()
    if _SYNCED.search(str(real)):
        told = f"{real} looks like a folder that is synchronised"
        wish = "a program that copies the files while they change destroys them; move it"
        found.append(Finding("place", "problem", told, wish))
    kind = _file_system(real, mounts)
    if kind is not None and _NETWORK.match(kind):
        told = f"{real} is on a network or user-space file system ({kind})"
        wish = "locks and syncs cannot be relied on there; use a disk of this machine"
        found.append(Finding("place", "problem", told, wish))
    return found


def left_behind(database: Path, *, is_served: bool) -> list[Finding]:
    """Check for files that something left that was killed, and for copies that nobody can vouch for."""
    found = []
    instance = database.parent
    for suffix in ("-journal", "-wal"):
        path = database.with_name(database.name + suffix)
        if not is_served and path.exists() and path.stat().st_size:
            told = f"{path.name} is there and no server runs: one was killed, or something has the database open"
            wish = (
                "leave it there: whatever opens the database next works it in, and never copy the database without it"
            )
            found.append(Finding("left behind", "warning", told, wish))
    for pattern in (".snapshot-*", ".restore-*", ".backup-*"):
        for path in (*instance.glob(pattern), *(instance / "backups").glob(pattern)):
            told = f"{path} is half-made, or in the making"
            found.append(Finding("left behind", "warning", told, "the next export, backup or restore removes it"))
    for path in instance.iterdir():
        if path.name.startswith("replaced-") or path == database or not path.is_file():
            continue
        with path.open("rb") as file:
            if file.read(len(_HEADER)) == _HEADER and not path.name.startswith("."):
                told = f"{path.name} is a copy of a database that has no manifest, and may be torn"
                found.append(Finding("left behind", "problem", told, "use `xar backup` for backups, and remove it"))
    return worst("left behind", found, "nothing half-made")


def holders(database: Path, processes: Path = Path("/proc")) -> Finding:
    """Name the programs of this user that have the database open besides ours."""
    strangers = []
    for process in processes.glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        try:
            is_open = any(database.samefile(handle) for handle in (process / "fd").iterdir() if handle.exists())
            words = (process / "cmdline").read_bytes().split(b"\0") if is_open else []
        except OSError:
            continue
        name = " ".join(word.decode("utf-8", "replace") for word in words if word)[:60]
        if is_open and not re.search(r"\bxar\b|webapp|gunicorn", name):
            strangers.append(f"{process.name} ({name})")
    if strangers:
        told = f"open in other programs: {', '.join(strangers)}"
        return Finding("other programs", "warning", told, "close them while people take part: they may hold up answers")
    return Finding("other programs", "ok", "none has the database open")


def settings_findings(*, host: str, is_local: bool, https: bool, trusted_hosts: tuple[str, ...]) -> list[Finding]:
    """Check the settings that decide who can read along.

    Args:
        host: The address to listen on.
        is_local: Whether that is this machine alone.
        https: Whether participants come by https.
        trusted_hosts: The names under which the server may be addressed.
    """
    found = []
    if not is_local and not https:
        told = f"listens on {host} and XAR_HTTPS is off: passwords and answers can be read on their way"
        found.append(
            Finding("settings", "problem", told, "put a proxy with a certificate before it and set XAR_HTTPS=yes")
        )
    if not trusted_hosts:
        told = f"listens on {host} and answers to any name"
        found.append(Finding("settings", "warning", told, "set XAR_TRUSTED_HOSTS to the name in the study's links"))
    found += [
        Finding("settings", "problem", f"{name} is set", "unset it where people take part")
        for name in ("FLASK_DEBUG", "PYTHONDEVMODE", "PYTHONINSPECT")
        if os.environ.get(name, "0") not in {"", "0"}
    ]
    names = ", ".join(trusted_hosts)
    return worst("settings", found, f"listens on {host}{', by https' if https else ''}, known as {names}")


def _file_system(folder: Path, mounts: Path) -> str | None:
    """Return the kind of file system of a folder, or None where the machine does not say."""
    try:
        lines = mounts.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    best, kind = -1, None
    for line in lines:
        _, at, name, *_ = line.split(" ")
        point = Path(re.sub(r"\\([0-7]{3})", lambda found: chr(int(found[1], 8)), at))
        # Of two that are mounted on one place, the later one is seen.
        if folder.is_relative_to(point) and len(point.parts) >= best:
            best, kind = len(point.parts), name
    return kind
