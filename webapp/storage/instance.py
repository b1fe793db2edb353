"""The instance folder: where the database, the secret key and the bundles live, readable by their owner alone."""

import fcntl
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_KEY_BYTES = 32
_LOCK = "server.lock"


class InstanceError(RuntimeError):
    """An instance folder that cannot be used; the message says what to do."""


def prepare_instance(folder: Path) -> None:
    """Make the instance folder if there is none, and close it to everyone but its owner (mode 0700).

    Raises:
        InstanceError: The folder cannot be made or closed.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_mode & 0o077:
            folder.chmod(0o700)
    except OSError as error:
        raise InstanceError(f"the instance folder {folder} cannot be used: {error.strerror}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InstanceError(f"the instance folder {folder} cannot be written to")


def secret_key(folder: Path) -> bytes:
    """Return the key that signs cookies and page nonces; it is made once, at random.

    Args:
        folder: The instance folder.

    Returns:
        32 bytes.

    Raises:
        InstanceError: The key file cannot be read, is readable by others, or does not hold a key.
    """
    path = folder / "secret_key"
    try:
        if not path.exists():
            _write_key(path)
        if path.stat().st_mode & 0o077:
            raise InstanceError(f"{path} can be read by others; run `chmod 600 {path}`, or delete it to get a new key")
        key = path.read_bytes()
    except OSError as error:
        raise InstanceError(f"{path} cannot be used: {error.strerror}") from error
    if len(key) != _KEY_BYTES:
        raise InstanceError(f"{path} holds {len(key)} bytes, not {_KEY_BYTES}; delete it to get a new key")
    return key


def _write_key(path: Path) -> None:
    """Write a whole key or nothing; where two processes do so at once, the first one's key stays."""
    draft = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(secrets.token_bytes(_KEY_BYTES))
            file.flush()
            os.fsync(file.fileno())
        try:
            path.hardlink_to(draft)
        except FileExistsError:
            return
    finally:
        draft.unlink()


@contextmanager
def only_server(folder: Path) -> Iterator[None]:
    """Hold the instance for one server, for as long as the context lasts.

    The lock belongs to the process: it is free again when the process ends, however it ends.

    Raises:
        InstanceError: Another server runs on this instance, or the lock cannot be opened.
    """
    path = folder / _LOCK
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise InstanceError(f"{path} cannot be used: {error.strerror}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InstanceError(
                f"another server is running on the instance {folder}; stop it, or set XAR_INSTANCE to another folder"
            ) from None
        os.ftruncate(descriptor, 0)
        yield
    finally:
        os.close(descriptor)


def note_address(folder: Path, address: str) -> None:
    """Note where the server of an instance can be reached, for programs on this machine."""
    (folder / _LOCK).write_text(f"{address}\n", encoding="utf-8")


def running_server(folder: Path) -> str | None:
    """Return where the server of an instance can be reached, or None if none runs, or it does not listen yet."""
    path = folder / _LOCK
    try:
        descriptor = os.open(path, os.O_RDWR)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return path.read_text(encoding="utf-8").strip() or None
    finally:
        os.close(descriptor)
    return None
