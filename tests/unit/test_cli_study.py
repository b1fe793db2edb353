"""`xar study`: new, check, publish, verify."""

import json
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from sqlalchemy import select
from sqlalchemy.exc import DBAPIError

from tests.unit.stimuli.study_folders import change, nobody, quietly, set_texts, small_study
from webapp.command_line import OneLineErrors
from webapp.commands.publishing import Published, publish_study
from webapp.commands.studying import study
from webapp.config import Config
from webapp.stimuli import build, publication
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.catalogue import BundleError
from webapp.stimuli.program import Program
from webapp.stimuli.publication import check_published, point_at, unlock
from webapp.storage.database import DatabaseError, open_database
from webapp.storage.tables import record_contents, records
from webapp.storage.verification import verify_log
from webapp.study.problems import StudyError

NOW = datetime(2026, 11, 27, 12, tzinfo=UTC)


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    return tmp_path / "instance"


@pytest.fixture
def ready(tmp_path: Path) -> Path:
    """A small study in which everything is filled in."""
    folder = small_study(tmp_path)
    file = folder / "study.toml"
    change(file, '"<name and e-mail address of the responsible researcher>"', '"office@example.org"')
    change(file, '"<name of the ethics committee and number of the approval>"', '"Committee, 1"')
    change(file, '"<date, such as 2030-12-31>"', '"2031-12-31"')
    return folder


def xar(instance: Path, *arguments: object) -> Result:
    main = OneLineErrors("xar", commands={"study": study})
    environment = {"XAR_INSTANCE": str(instance), "COLUMNS": "200"}
    return CliRunner().invoke(main, ["study", *map(str, arguments)], env=environment, prog_name="xar")


def publish(folder: Path, instance: Path, note: str = "") -> Published:
    return publish_study(folder, Config(instance), note, NOW, quietly, planner_agents)


def published_records(instance: Path) -> list[Mapping[str, object]]:
    with open_database(instance / "xar.sqlite3") as database, database.read() as connection:
        rows = connection.execute(
            select(records.c.action, records.c.study_version, record_contents.c.content).join(
                record_contents, records.c.number == record_contents.c.number
            )
        ).all()
    assert {row.action for row in rows} <= {"published"}
    return [{"study_version": row.study_version, **json.loads(row.content)} for row in rows]


def test_a_new_study_is_written_passes_its_check_and_is_not_overwritten(tmp_path: Path, instance: Path) -> None:
    written = xar(instance, "new", "mine", "--into", tmp_path)
    assert (written.exit_code, written.stderr) == (0, "")
    assert f"xar study check {tmp_path}/mine" in written.stdout
    checked = xar(instance, "check", tmp_path / "mine")
    assert (checked.exit_code, checked.stderr) == (0, "")
    again = xar(instance, "new", "mine", "--into", tmp_path)
    assert (again.exit_code, again.stdout) == (2, "")
    assert (
        again.stderr == f"xar: {tmp_path}/mine is there already; choose another name, or another folder with --into\n"
    )


def test_a_check_tells_arms_warnings_length_and_notes(tmp_path: Path, instance: Path) -> None:
    xar(instance, "new", "mine", "--into", tmp_path)
    told = xar(instance, "check", tmp_path / "mine").stdout
    for part in (
        "Warning: 'full' has 13 more pictures than 'random' in layout 'experiment1-b'",
        "the study was not built since it changed",
        "238 words per minute",
        "Every arrangement is used equally often after each 6 participants",
        "Note: before `xar serve --live`, fill in contact, ethics_approval, retention_until",
    ):
        assert part in told
    assert not instance.exists()


def test_a_check_can_be_read_by_programs(tmp_path: Path, instance: Path) -> None:
    xar(instance, "new", "mine", "--into", tmp_path)
    found = json.loads(xar(instance, "check", tmp_path / "mine", "--json").stdout)
    assert (found["study"], found["agents"], found["full_round"]) == ("mine", "planner", 6)
    (full, *_) = found["arms"][0]["arms"]
    assert (full["kind"], full["measures"]["pictures"]["mean"]) == ("full", 18)
    assert found["minutes"]["shortest"] <= found["minutes"]["median"] <= found["minutes"]["longest"]
    assert any("'full' has" in warning for warning in found["arms"][0]["warnings"])


def test_several_problems_are_told_line_by_line_with_exit_status_2(tmp_path: Path, instance: Path) -> None:
    xar(instance, "new", "mine", "--into", tmp_path)
    change(tmp_path / "mine" / "study.toml", "num_draws = 10", "num_draws = 0")
    (tmp_path / "mine" / "texts" / "ja.toml").unlink()
    checked = xar(instance, "check", tmp_path / "mine")
    assert (checked.exit_code, checked.stdout) == (2, "")
    first, second, last = checked.stderr.splitlines()
    assert first.endswith(": explanation.num_draws: is 0; use 1 or more")
    assert second == f"{tmp_path}/mine/texts/ja.toml: is missing"
    assert last == "xar: the study cannot be used; 2 problems are listed above"


def test_a_study_that_is_not_there_is_refused_in_one_line(instance: Path) -> None:
    for verb in ("check", "publish"):
        result = xar(instance, verb, "nowhere")
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.startswith("xar: there is no study 'nowhere'; use sakai2021 or understanding, or a folder")


def test_placeholders_are_not_published(tmp_path: Path, instance: Path) -> None:
    result = xar(instance, "publish", small_study(tmp_path))
    assert (result.exit_code, result.stdout) == (2, "")
    assert (
        "study.toml, line 16: contact: is still a placeholder; fill it in before the study is published"
        in result.stderr
    )
    assert not (instance / "bundles").exists()


def test_publishing_freezes_records_and_points(ready: Path, instance: Path) -> None:
    published = publish(ready, instance, "First wave")
    assert (published.is_new, published.is_recorded, published.previous, published.changes) == (True, True, None, ())
    folder = check_published(instance, "sakai2021")
    assert folder.name == published.version
    assert all(path.stat().st_mode & 0o222 == 0 for path in (folder, *folder.rglob("*")))
    (record,) = published_records(instance)
    assert record["study_version"] == record["version"] == published.version
    assert (record["note"], record["previous"], record["changes"]) == ("First wave", None, [])
    with open_database(instance / "xar.sqlite3") as database:
        assert verify_log(database).problems == ()


def test_publishing_the_same_again_does_nothing(ready: Path, instance: Path) -> None:
    first, again = publish(ready, instance), publish(ready, instance)
    assert (again.is_new, again.is_recorded, again.version) == (False, False, first.version)
    assert again.lines() == [f"Study sakai2021 is published as it is: version {first.version}. Nothing was done."]
    assert len(published_records(instance)) == 1


def test_publishing_a_changed_study_makes_another_version_and_says_what_changed(ready: Path, instance: Path) -> None:
    first = publish(ready, instance)
    set_texts(ready, {"instructions.start": "Ready"})
    assert check_published(instance, "sakai2021").name == first.version
    second = publish(ready, instance)
    assert second.previous == first.version != second.version
    assert second.changes == ("catalogue.json changed", "sources/study/texts/en.toml changed")
    assert second.lines()[1:] == [
        f"It takes the place of version {first.version}. What changed:",
        "  catalogue.json changed",
        "  sources/study/texts/en.toml changed",
    ]
    assert published_records(instance)[1]["changes"] == list(second.changes)
    assert check_published(instance, "sakai2021").name == second.version
    assert (instance / "bundles" / first.version).is_dir()


def test_after_a_change_of_the_program_publishing_makes_another_version_of_the_same_pictures(
    ready: Path, instance: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = publish(ready, instance)
    for module in (build, publication):
        monkeypatch.setattr(module, "running_program", lambda: Program("9.9", "f" * 64))
    with pytest.raises(
        BundleError, match=r"and this is 9\.9 \(ffffffffffff\); run `xar study publish` with its folder"
    ):
        check_published(instance, "sakai2021")
    second = publish(ready, instance)
    (change_told,) = second.changes
    assert change_told.startswith("program ")
    assert change_told.endswith(" is now 9.9 (ffffffffffff)")
    assert check_published(instance, "sakai2021").name == second.version != first.version


def test_what_cannot_be_recorded_is_not_published(ready: Path, instance: Path) -> None:
    instance.mkdir(mode=0o700)
    (instance / "xar.sqlite3").write_text("no database", encoding="utf-8")
    with pytest.raises(DatabaseError, match=r"xar\.sqlite3"):
        publish(ready, instance)
    with pytest.raises(BundleError, match="is not published"):
        check_published(instance, "sakai2021")


def break_commits(instance: Path) -> None:
    """Let every transaction that writes a record fail when it is to be committed, and not before."""
    with closing(sqlite3.connect(instance / "xar.sqlite3")) as connection:
        connection.executescript(
            "CREATE TABLE broken (number REFERENCES records (number) DEFERRABLE INITIALLY DEFERRED);"
            "CREATE TRIGGER breaks AFTER INSERT ON records BEGIN INSERT INTO broken VALUES (-1); END;"
        )


def mend_commits(instance: Path) -> None:
    with closing(sqlite3.connect(instance / "xar.sqlite3")) as connection:
        connection.executescript("DROP TRIGGER breaks; DROP TABLE broken;")


def test_a_record_that_does_not_reach_the_disk_publishes_nothing_and_publishing_again_does(
    ready: Path, instance: Path
) -> None:
    first = publish(ready, instance)
    break_commits(instance)
    set_texts(ready, {"instructions.start": "Ready"})
    with pytest.raises(DBAPIError, match="FOREIGN KEY"):
        publish(ready, instance)
    assert check_published(instance, "sakai2021").name == first.version
    assert len(published_records(instance)) == 1
    mend_commits(instance)
    second = publish(ready, instance)
    assert (second.is_new, second.is_recorded, second.previous) == (True, True, first.version)
    assert check_published(instance, "sakai2021").name == second.version
    assert [record["version"] for record in published_records(instance)] == [first.version, second.version]


def test_a_published_version_whose_record_is_missing_is_recorded_by_publishing_it_again(
    ready: Path, instance: Path
) -> None:
    first = publish(ready, instance)
    set_texts(ready, {"instructions.start": "Ready"})
    second = build.build(ready, instance, quietly, planner_agents).catalogue.version
    point_at(instance, "sakai2021", second)
    late, again = publish(ready, instance, "Late"), publish(ready, instance)
    assert (late.is_new, late.is_recorded, late.previous) == (False, True, first.version)
    assert late.lines() == [
        f"Study sakai2021 is published as it is: version {second}. Its record was missing and is written now."
    ]
    assert (again.is_new, again.is_recorded) == (False, False)
    _, record = published_records(instance)
    assert (record["version"], record["previous"], record["note"]) == (second, first.version, "Late")
    assert record["changes"] == ["catalogue.json changed", "sources/study/texts/en.toml changed"]


def test_going_back_to_an_earlier_version_is_recorded_too(ready: Path, instance: Path) -> None:
    first = publish(ready, instance)
    declared = (ready / "study.toml").read_bytes()
    change(ready / "study.toml", "seed = 2021", "seed = 2021  # Any will do.")
    second = publish(ready, instance)
    (ready / "study.toml").write_bytes(declared)
    publish(ready, instance)
    assert check_published(instance, "sakai2021").name == first.version
    versions = [record["version"] for record in published_records(instance)]
    assert versions == [first.version, second.version, first.version]


def test_a_bundle_that_cannot_be_closed_is_neither_recorded_nor_published(
    ready: Path, instance: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(folder: Path) -> None:
        raise PermissionError(folder)

    with monkeypatch.context() as closed:
        closed.setattr(publication, "lock", refuse)
        with pytest.raises(PermissionError):
            publish(ready, instance)
    assert published_records(instance) == []
    with pytest.raises(BundleError, match="is not published"):
        check_published(instance, "sakai2021")


def test_a_study_that_cannot_be_used_is_not_published(ready: Path, instance: Path) -> None:
    change(ready / "study.toml", "num_draws = 10", "num_draws = 0")
    with pytest.raises(StudyError, match="num_draws"):
        publish_study(ready, Config(instance), "", NOW, quietly, nobody)


def test_a_published_version_is_proven(ready: Path, instance: Path) -> None:
    published = publish(ready, instance)
    result = xar(instance, "verify", "sakai2021")
    assert result.exit_code == 0
    assert f"Version {published.version}" in result.stdout
    assert "Proven: built again from its own files, it shows participants the same." in result.stdout
    found = json.loads(xar(instance, "verify", "sakai2021", "--json", "--version", published.version[:8]).stdout)
    assert (found["is_proven"], found["is_whole"], found["weights"]) == (True, True, None)


def test_a_damaged_version_is_found_with_exit_status_1(ready: Path, instance: Path) -> None:
    folder = instance / "bundles" / publish(ready, instance).version
    unlock(folder)
    picture = next(iter(sorted((folder / "pictures").iterdir())))
    picture.write_bytes(picture.read_bytes()[:-1] + b"\0")
    result = xar(instance, "verify", "sakai2021")
    assert result.exit_code == 1
    assert f"Differs: pictures/{picture.name}" in result.stdout
    assert "they were changed after it was built" in result.stdout
    assert "Not proven" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["sakai2021"], "xar: there is no bundle of study 'sakai2021' in "),
        (["sakai2021", "--version", "abc"], "xar: no version begins with 'abc' in "),
    ],
)
def test_what_was_never_built_cannot_be_verified(arguments: list[str], problem: str, instance: Path) -> None:
    result = xar(instance, "verify", *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(problem)
