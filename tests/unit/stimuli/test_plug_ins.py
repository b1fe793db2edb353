"""How a study's own code is imported, and that nothing of it stays behind."""

import functools
import hashlib
import sys
from pathlib import Path

import pytest

from webapp.stimuli.plug_ins import KINDS_GROUP, find, origin_of, study_modules


def write(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return folder


def found(folder: Path, use: str) -> object:
    with study_modules(folder):
        return find(use, KINDS_GROUP, folder)


def test_studies_may_have_modules_of_one_name(tmp_path: Path) -> None:
    folders = [write(tmp_path / name, "mine.py", f"answer = {name!r}") for name in ("a", "b")]
    assert [found(folder, "mine:answer") for folder in folders] == ["a", "b"]


def test_nothing_of_a_study_stays_behind(tmp_path: Path) -> None:
    write(tmp_path, "mine.py", "import mine_too\nanswer = mine_too.answer")
    write(tmp_path, "mine_too.py", "import decimal\nanswer = 3")
    path, modules = list(sys.path), set(sys.modules)
    assert found(tmp_path, "mine:answer") == 3
    assert sys.path == path
    assert not {"mine", "mine_too"} & (sys.modules.keys() - modules)


def test_within_one_build_a_module_is_imported_once(tmp_path: Path) -> None:
    write(tmp_path, "mine.py", "answer = object()")
    with study_modules(tmp_path):
        first = found(tmp_path, "mine:answer")
        assert found(tmp_path, "mine:answer") is first


def test_what_fails_restores_the_path_too(tmp_path: Path) -> None:
    path = list(sys.path)
    with pytest.raises(ValueError, match="there is no module 'mine'"):
        found(tmp_path, "mine:answer")
    assert sys.path == path


def test_a_name_within_a_class_can_be_used(tmp_path: Path) -> None:
    write(tmp_path, "mine.py", "class Mine:\n    answer = 4")
    assert found(tmp_path, "mine:Mine.answer") == 4


def test_a_module_that_hides_an_installed_one_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "json.py", "answer = 5")
    with pytest.raises(ValueError, match=r"'json' is another than json\.py beside the study file; rename the file"):
        found(tmp_path, "json:answer")


def test_a_package_in_the_studys_folder_can_be_used_unless_it_hides_an_installed_one(tmp_path: Path) -> None:
    write(tmp_path, "mine/__init__.py", "answer = 6")
    write(tmp_path, "json/__init__.py", "answer = 7")
    assert found(tmp_path, "mine:answer") == 6
    with pytest.raises(ValueError, match=r"'json' is another than json/__init__\.py beside the study file; rename"):
        found(tmp_path, "json:answer")


def test_the_origin_of_code_beside_the_study_file_is_its_digest(tmp_path: Path) -> None:
    write(tmp_path, "mine.py", "def choose(task): ...")
    with study_modules(tmp_path):
        origin = origin_of("mine:choose", find("mine:choose", KINDS_GROUP, tmp_path), tmp_path)
    digest = hashlib.sha256((tmp_path / "mine.py").read_bytes()).hexdigest()
    assert origin.to_json() == {"use": "mine:choose", "distribution": None, "digest": digest}


def test_the_origin_of_installed_code_is_its_package_too(tmp_path: Path) -> None:
    origin = origin_of("pytest:fixture", pytest.fixture, tmp_path)
    assert origin.distribution == f"pytest {pytest.__version__}"
    assert origin.digest is not None
    assert origin_of("builtins:len", len, tmp_path).digest is None
    assert origin_of("x:y", functools.partial(len), tmp_path).distribution is None
