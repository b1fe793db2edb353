"""`xar admin`, `xar verify-log` and `xar erase`."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.outside import outside
from tests.unit.storage.people import NOW, enrol_somebody, walk
from tests.web.reading import place
from webapp.cli import main
from webapp.storage.accounts import accounts, create_researcher
from webapp.storage.database import Database, open_database
from webapp.storage.records import told_by
from webapp.storage.researchers import sign_in

PASSWORD = "correct horse battery"  # noqa: S105


@pytest.fixture
def database(instance: Path) -> Iterator[Database]:
    with open_database(place(instance)) as database:
        yield database


def xar(instance: Path, *words: str, typed: str = "") -> Result:
    return CliRunner().invoke(main, words, input=typed, env={"XAR_INSTANCE": str(instance)})


def test_an_account_gets_the_role_that_is_asked_for(instance: Path, database: Database) -> None:
    made = xar(instance, "admin", "create", "watcher", "--role", "viewer", "--generate-password")
    assert made.exit_code == 0
    assert "it is a viewer" in made.output
    assert xar(instance, "admin", "create", "boss", "--generate-password").exit_code == 0
    assert [(account.name, account.role) for account in accounts(database, NOW)] == [
        ("watcher", "viewer"),
        ("boss", "owner"),
    ]
    listed = xar(instance, "admin", "list").output.splitlines()
    assert [line.partition(",")[0] for line in listed] == ["watcher: viewer", "boss: owner"]


def test_roles_change_and_accounts_are_closed_by_command(instance: Path, database: Database) -> None:
    create_researcher(database, "boss", PASSWORD, NOW)
    assert "is an admin now" in xar(instance, "admin", "role", "boss", "admin").output
    assert accounts(database, NOW)[0].role == "admin"
    assert sign_in(database, "boss", PASSWORD, NOW) is not None
    assert "sessions ended: 1" in xar(instance, "admin", "sign-out", "boss").output
    assert "is closed" in xar(instance, "admin", "disable", "boss").output
    assert sign_in(database, "boss", PASSWORD, NOW) is None
    assert ", closed " in xar(instance, "admin", "list").output


@pytest.mark.usefixtures("database")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("role", "nobody", "viewer"), "there is no account 'nobody'; there are none"),
        (("role", "nobody", "king"), "'king' is not one of 'viewer', 'owner', 'admin'"),
        (("disable", "nobody"), "there is no account 'nobody'"),
        (("sign-out", "nobody"), "there is no account 'nobody'"),
    ],
)
def test_what_cannot_be_done_to_an_account_is_said_in_one_line(
    instance: Path, words: tuple[str, ...], message: str
) -> None:
    refused = xar(instance, "admin", *words)
    assert refused.exit_code == 2
    assert message in refused.output
    assert refused.output.count("\n") == 1


def test_a_log_is_verified_by_command_and_a_change_found(instance: Path, database: Database) -> None:
    walk(database, enrol_somebody(database), 3)
    good = xar(instance, "verify-log", "--json")
    found = json.loads(good.output)
    assert (good.exit_code, found["records"], found["problems"]) == (0, 5, [])
    head = f"{found['records']}:{found['head']}"
    walk(database, enrol_somebody(database), 1)
    assert xar(instance, "verify-log", "--head", head).exit_code == 0
    assert "Everything is as it was recorded." in xar(instance, "verify-log").output
    with outside(database) as connection:
        connection.disarm()
        connection.execute("UPDATE ratings SET rating = 1")
        connection.commit()
    bad = xar(instance, "verify-log")
    assert bad.exit_code == 1
    assert "record 5 (sent, page 3): what it tells was changed" in bad.output
    assert xar(instance, "verify-log", "--head", f"5:{'0' * 64}").exit_code == 1
    refused = xar(instance, "verify-log", "--head", "5")
    assert (refused.exit_code, "use NUMBER:HASH" in refused.output) == (2, True)


def test_somebody_is_erased_by_command_after_being_asked(instance: Path, database: Database) -> None:
    person = enrol_somebody(database)
    assert xar(instance, "erase", person.code, typed="n\n").exit_code != 0
    assert xar(instance, "verify-log", "--json").output.count('"erased": 0') == 1
    done = xar(instance, "erase", person.code, typed="y\n")
    assert done.exit_code == 0
    assert "is erased" in done.output
    again = xar(instance, "erase", person.code, "--yes")
    assert (again.exit_code, again.output) == (2, f"xar: there is no participant '{person.code}'\n")
    assert xar(instance, "verify-log").exit_code == 0


def test_a_password_is_changed_by_command_and_signs_out(instance: Path, database: Database) -> None:
    create_researcher(database, "boss", PASSWORD, NOW)
    assert sign_in(database, "boss", PASSWORD, NOW) is not None
    changed = xar(instance, "admin", "password", "boss", "--generate-password")
    assert changed.exit_code == 0
    assert accounts(database, NOW)[0].num_sessions == 0
    assert sign_in(database, "boss", PASSWORD, NOW) is None
    assert sign_in(database, "boss", changed.output.split()[-1], NOW) is not None
    short = xar(instance, "admin", "password", "boss", typed="short\n")
    assert (short.exit_code, "at least 12 characters" in short.output) == (2, True)


def test_an_export_is_recorded_and_one_of_nobody_refused(instance: Path, database: Database, tmp_path: Path) -> None:
    enrol_somebody(database, version="abcdef")
    assert xar(instance, "export", str(tmp_path / "all"), "--study", "sakai2021", "--mode", "test").exit_code == 0
    with database.read() as connection:
        ((_, _, actor, _, _, _, content),) = told_by(connection, "downloaded")
    assert (actor, content["file"], content["mode"]) == ("(command line)", "the data set", "test")
    refused = xar(instance, "export", str(tmp_path / "none"), "--study", "nope")
    assert refused.exit_code == 2
    assert refused.output == "xar: there are no data of nope; there are data of sakai2021 abcdef\n"
    assert not (tmp_path / "none").exists()
