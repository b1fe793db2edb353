"""A data set holds what was declared before there were data, byte for byte as it was frozen."""

import hashlib
import io
import json
import zipfile
from pathlib import Path

import pytest

from tests.unit.storage.exported import LATER, STUDY, files_of, take_part, wanted_of
from tests.unit.storage.people import enrol_somebody
from tests.web.bundles import write_bundle
from webapp.storage.database import Database
from webapp.storage.dataset import export, write_archive
from webapp.storage.wanted import Wanted
from webapp.study.sections import AnalysisPlan

PLANNED = STUDY.model_copy(update={"analysis": AnalysisPlan(plan="plan.md")})
SOURCES = {
    "study.toml": 'name = "sakai2021" # 説明\r\n'.encode(),
    "plan.md": b"A mixed model.\xff\n",
    "notes.md": b"Only the study file and the plan are declared.",
    "texts/en.toml": b"",
}


@pytest.fixture
def version(database: Database) -> str:
    """A version with its sources, in which somebody took part twice: live, and as a test."""
    version = write_bundle(database.path.parent, PLANNED, SOURCES)
    for mode in ("live", "test"):
        enrol_somebody(database, mode, version, study=PLANNED)
    return version


def declared(files: dict[str, bytes]) -> dict[str, bytes]:
    return {name: content for name, content in files.items() if name.startswith("studies/")}


def test_the_study_file_and_the_plan_are_there_byte_for_byte_and_once(
    version: str, database: Database, tmp_path: Path
) -> None:
    export(database, tmp_path / "out", wanted_of(database), LATER)
    files = files_of(tmp_path / "out")
    folder = f"studies/{STUDY.name}-{version[:12]}"
    assert declared(files) == {f"{folder}/{name}": SOURCES[name] for name in ("study.toml", "plan.md")}
    told = json.loads(files["manifest.json"])["files"]
    for name, content in declared(files).items():
        assert told[name] == {"rows": None, "bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    assert "studies/" in files[".psychdsignore"].decode().split()
    assert b"studies/ " in files["README.txt"]


def test_the_archive_has_them_too(version: str, database: Database) -> None:
    file = io.BytesIO()
    write_archive(database, file, wanted_of(database), LATER)
    with zipfile.ZipFile(file) as archive:
        assert archive.read(f"studies/{STUDY.name}-{version[:12]}/study.toml") == SOURCES["study.toml"]


def test_a_version_without_a_plan_in_words_has_its_study_file_alone(database: Database, tmp_path: Path) -> None:
    version = write_bundle(database.path.parent, STUDY, SOURCES)
    enrol_somebody(database, "live", version, study=STUDY)
    export(database, tmp_path / "out", wanted_of(database), LATER)
    assert [*declared(files_of(tmp_path / "out"))] == [f"studies/{STUDY.name}-{version[:12]}/study.toml"]


def test_a_version_whose_bundle_is_gone_or_older_than_kept_sources_has_none(
    version: str, database: Database, tmp_path: Path
) -> None:
    export(database, tmp_path / "gone", Wanted(), LATER)
    assert declared(files_of(tmp_path / "gone")) == {}
    take_part(database)
    found = wanted_of(database).find_bundle
    export(database, tmp_path / "older", Wanted(find_bundle=lambda one: None if one == version else found(one)), LATER)
    assert declared(files_of(tmp_path / "older")) == {}
