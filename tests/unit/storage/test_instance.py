import subprocess
import sys
import threading
from pathlib import Path

import pytest

from webapp.storage.instance import InstanceError, only_server, prepare_instance, secret_key

_HOLD = """
import sys
from pathlib import Path
from webapp.storage.instance import only_server
with only_server(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_the_folder_is_for_its_owner_alone_even_if_it_was_open(tmp_path: Path) -> None:
    fresh, old = tmp_path / "deep" / "fresh", tmp_path / "old"
    old.mkdir(mode=0o755)
    for folder in (fresh, old):
        prepare_instance(folder)
        assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_cannot_be_made_is_told_in_words(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InstanceError, match="cannot be used"):
        prepare_instance(tmp_path / "file")


def test_the_key_is_made_once_and_stays(tmp_path: Path) -> None:
    key = secret_key(tmp_path)
    assert len(key) == 32
    assert secret_key(tmp_path) == key
    assert (tmp_path / "secret_key").stat().st_mode & 0o777 == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["secret_key"]
    other = tmp_path / "other"
    other.mkdir()
    assert secret_key(other) != key


def test_simultaneous_starts_agree_on_one_key(tmp_path: Path) -> None:
    keys: list[bytes] = []
    barrier = threading.Barrier(8)

    def start() -> None:
        barrier.wait()
        keys.append(secret_key(tmp_path))

    threads = [threading.Thread(target=start) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(keys) == 8
    assert len(set(keys)) == 1


def test_a_key_that_others_can_read_is_refused(tmp_path: Path) -> None:
    secret_key(tmp_path)
    (tmp_path / "secret_key").chmod(0o640)
    with pytest.raises(InstanceError, match="chmod 600"):
        secret_key(tmp_path)


def test_a_key_that_is_cut_short_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "secret_key"
    path.touch(mode=0o600)
    with pytest.raises(InstanceError, match="0 bytes"):
        secret_key(tmp_path)


def test_a_key_or_a_lock_that_cannot_be_opened_is_told_in_words(tmp_path: Path) -> None:
    (tmp_path / "secret_key").mkdir(mode=0o700)
    (tmp_path / "server.lock").mkdir()
    with pytest.raises(InstanceError, match=r"secret_key cannot be used: Is a directory"):
        secret_key(tmp_path)
    with pytest.raises(InstanceError, match=r"server\.lock cannot be used: Is a directory"), only_server(tmp_path):
        pass


def test_a_second_server_is_refused_until_the_first_one_is_gone(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        with pytest.raises(InstanceError, match="another server"), only_server(tmp_path):
            pass
        first.kill()
    with only_server(tmp_path):
        pass
