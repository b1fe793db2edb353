"""`xar serve`, `xar admin create`, `xar export`, `xar recruits`, `xar reconcile`, each in a process of its own."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.unit.storage.people import enrol_somebody
from tests.web.bundles import FILLED_IN, read_study, write_bundle
from tests.web.reading import ask, num_rows, place
from tests.web.servers import XAR, environment, run, serving
from webapp.storage.database import open_database
from webapp.storage.dataset import data_name
from webapp.storage.exports import FILE_NAMES
from webapp.study.recruitment import Recruit

_WORK = """
import json, sys
from pathlib import Path
from tests.web.people import Visitor
from webapp.app import create_app
from webapp.config import Config
from webapp.storage.accounts import create_researcher
from webapp.views.services import services_of, utc_now

app = create_app(Config(Path(sys.argv[1])))
create_researcher(services_of(app).database, "researcher", "correct horse battery", utc_now())
visitor = Visitor(app)
visitor.agree()
visitor.walk()
visitor.post("/researcher/sign-in", {"name": "researcher", "password": "correct horse battery"})
visitor.post("/researcher/unblind", {"reason": "to look", "password": "correct horse battery"})
paths = ("/done", "/researcher/", "/researcher/results", "/researcher/people", "/researcher/ratings.csv")
statuses = [visitor.get(path).status_code for path in paths]
print(json.dumps({"statuses": statuses, "modules": sorted({name.partition(".")[0] for name in sys.modules})}))
"""


def get(port: int, path: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", path)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def test_the_web_process_holds_no_learning_no_numerics_and_no_drawing(instance: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _WORK, str(instance)],
        env=environment(instance),
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    found = json.loads(done.stdout)
    assert found["statuses"] == [200] * 5
    heavy = {"gymnasium", "matplotlib", "minigrid", "numpy", "pandas", "PIL", "pygame", "scipy", "statsmodels", "torch"}
    assert heavy & set(found["modules"]) == set()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_server_prints_its_addresses_serves_and_stops_cleanly(instance: Path, number: signal.Signals) -> None:
    with serving(instance) as server:
        assert server.lines == [
            f"Participants: http://127.0.0.1:{server.port}/",
            f"Dashboard:    http://127.0.0.1:{server.port}/researcher/",
            "Test run: answers are marked as a test.",
        ]
        status, text = get(server.port, "/")
        assert status == 200
        assert "test run" in text
        assert get(server.port, "/healthz") == (200, "ok\n")
        assert server.stop(number) == (0, "")


def test_a_second_server_on_the_same_instance_is_refused_in_one_line(instance: Path) -> None:
    with serving(instance):
        second = run(instance, "serve", "--port", "0")
    assert second.returncode == 2
    assert re.fullmatch(r"xar: another server is running on the instance .*\n", second.stderr)


def test_a_port_that_is_taken_is_refused_in_one_line(instance: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    write_bundle(other, read_study())
    with serving(other) as server:
        refused = run(instance, "serve", "--port", str(server.port))
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"xar: cannot listen on 127.0.0.1 port {server.port}: ")
    assert refused.stderr.count("\n") == 1


def test_live_is_refused_with_the_names_of_what_is_missing(instance: Path) -> None:
    refused = run(instance, "serve", "--live", "--port", "0")
    assert refused.returncode == 2
    assert re.fullmatch(r"xar: --live needs .*contact, ethics_approval, retention_until.*\n", refused.stderr)


def test_live_collects_data_once_the_study_file_is_filled_in(instance: Path) -> None:
    write_bundle(instance, read_study(**FILLED_IN))
    with serving(instance, "--live") as server:
        assert server.lines[2] == "Live: answers are data."
        assert "test run" not in get(server.port, "/")[1]


def test_without_a_bundle_the_server_says_what_to_do(tmp_path: Path) -> None:
    refused = run(tmp_path / "instance", "serve")
    assert refused.returncode == 2
    assert re.fullmatch(r"xar: there is no bundle .*xar build.*\n", refused.stderr)
    assert not (tmp_path / "instance" / "xar.sqlite3").exists()


def test_all_wrong_settings_are_named_at_once(instance: Path) -> None:
    refused = run(instance, "serve", XAR_PORT="http", XAR_HTTPS="perhaps", XAR_HOST="")
    assert refused.returncode == 2
    assert all(name in refused.stderr for name in ("XAR_PORT", "XAR_HTTPS", "XAR_HOST"))
    assert refused.stderr.count("\n") == 1


@pytest.mark.sqlite_only(reason="the mode of SQLite's file")
def test_the_instance_is_closed_to_others_even_if_it_was_open(instance: Path) -> None:
    instance.chmod(0o755)
    with serving(instance):
        assert instance.stat().st_mode & 0o777 == 0o700
        for name in ("xar.sqlite3", "secret_key", "server.lock"):
            assert (instance / name).stat().st_mode & 0o077 == 0


def test_a_key_that_others_can_read_is_refused(instance: Path) -> None:
    (instance / "secret_key").write_bytes(os.urandom(32))
    (instance / "secret_key").chmod(0o644)
    refused = run(instance, "serve")
    assert refused.returncode == 2
    assert "can be read by others" in refused.stderr


def test_an_account_gets_the_password_that_is_typed_twice(instance: Path) -> None:
    made = run(instance, "admin", "create", "researcher", entered="correct horse battery\n" * 2)
    assert made.returncode == 0, made.stderr
    assert "correct horse" not in made.stdout
    assert num_rows(instance, "researchers") == 1
    again = run(instance, "admin", "create", "researcher", entered="correct horse battery\n" * 2)
    assert again.returncode == 2
    assert "xar: there is an account 'researcher' already\n" in again.stderr


def test_a_password_is_typed_twice_at_a_terminal_and_not_shown(instance: Path) -> None:
    terminal, end = os.openpty()
    command = [*XAR, "admin", "create", "researcher"]
    with subprocess.Popen(command, env=environment(instance), stdin=end, stdout=end, stderr=end) as process:
        os.close(end)
        screen = b""
        for question in (b"Password: ", b"confirmation: "):
            while not screen.endswith(question):
                screen += os.read(terminal, 1000)
            os.write(terminal, b"correct horse battery\n")
        while b"is made" not in screen:
            screen += os.read(terminal, 1000)
        assert process.wait(60) == 0
    os.close(terminal)
    assert b"correct horse" not in screen
    assert num_rows(instance, "researchers") == 1


def test_a_bad_name_is_refused_before_a_password_is_asked_for(instance: Path) -> None:
    for words in ((), ("--generate-password",), ("--if-missing",)):
        refused = run(instance, "admin", "create", "", *words)
        assert (refused.returncode, refused.stdout) == (2, "")
        assert refused.stderr == "xar: '' cannot be a name; use 1 to 64 characters, no blanks at the ends\n"
    assert not (instance / "xar.sqlite3").exists()


def test_without_a_terminal_and_without_a_password_an_account_is_refused_in_one_line(instance: Path) -> None:
    closed = subprocess.run(
        ["/bin/sh", "-c", 'exec "$@" <&-', "sh", *XAR, "admin", "create", "researcher"],
        env=environment(instance),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    for refused in (closed, run(instance, "admin", "create", "researcher"), create_with("\n\n", instance)):
        assert (refused.returncode, refused.stdout) == (2, "")
        assert refused.stderr == "xar: there is no terminal to type a password at; use --generate-password\n"
    assert num_rows(instance, "researchers") == 0


def test_a_password_that_is_piped_in_need_not_be_repeated_but_must_not_change(instance: Path) -> None:
    refused = create_with("correct horse battery\ncorrect horse bakery\n", instance)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == "xar: the lines of standard input differ; give one password, once or twice\n"
    made = create_with("correct horse battery\n", instance)
    assert (made.returncode, made.stdout, made.stderr) == (0, "The account 'researcher' is made; it is an owner.\n", "")


def create_with(entered: str, instance: Path) -> subprocess.CompletedProcess[str]:
    return run(instance, "admin", "create", "researcher", entered=entered)


def test_a_password_that_is_too_short_is_refused(instance: Path) -> None:
    refused = run(instance, "admin", "create", "researcher", entered="short\n" * 2)
    assert refused.returncode == 2
    assert "at least 12 characters" in refused.stderr


def test_a_generated_password_is_printed_once_and_opens_the_dashboard(instance: Path) -> None:
    made = run(instance, "admin", "create", "researcher", "--generate-password", "--if-missing")
    (password,) = re.findall(r"shown only now: (\S{20})$", made.stdout, flags=re.MULTILINE)
    again = run(instance, "admin", "create", "researcher", "--generate-password", "--if-missing")
    assert again.returncode == 0
    assert "shown" not in again.stdout
    with serving(instance) as server:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
        headers = {"Content-Type": "application/x-www-form-urlencoded", "Sec-Fetch-Site": "same-origin"}
        connection.request("POST", "/researcher/sign-in", f"name=researcher&password={password}", headers)
        answer = connection.getresponse()
        assert (answer.status, answer.getheader("Location")) == (303, "/researcher/")
        connection.close()


def test_a_host_that_does_not_exist_is_refused_in_one_line(instance: Path) -> None:
    done = run(instance, "serve", "--host", "nosuch.invalid")
    assert done.returncode == 2
    assert done.stderr == "xar: cannot listen on nosuch.invalid port 8000: there is no such address\n"


def test_an_empty_study_name_is_refused_and_builds_nothing(instance: Path) -> None:
    done = run(instance, "build", "")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


@pytest.mark.sqlite_only(reason="it begins without SQLite's file")
def test_an_export_writes_a_whole_data_set_and_overwrites_nothing(instance: Path, tmp_path: Path) -> None:
    missing = run(instance, "export", str(tmp_path / "data"))
    assert missing.returncode == 2
    assert missing.stderr.startswith("xar: there is no database")
    run(instance, "admin", "create", "researcher", "--generate-password")
    with open_database(place(instance)) as database:
        enrol_somebody(database, "test")
    done = run(instance, "export", str(tmp_path / "data"))
    assert done.returncode == 0, done.stderr
    num_rows = {"participants.csv": 1, "allocation.csv": 2, "wide.csv": 1}
    assert done.stdout == "".join(
        f"{tmp_path}/data/{data_name(name)}: {num_rows.get(name, 0)} row{'' if num_rows.get(name) == 1 else 's'}\n"
        for name in FILE_NAMES
    )
    assert {path.name for path in (tmp_path / "data" / "spreadsheet").iterdir()} == set(FILE_NAMES)
    again = run(instance, "export", str(tmp_path / "data"))
    assert again.returncode == 2
    assert again.stderr == f"xar: {tmp_path}/data exists already and is not an empty folder; choose another one\n"


def test_an_export_holds_what_was_asked_for_alone(instance: Path, tmp_path: Path) -> None:
    with open_database(place(instance)) as database:
        for mode in ("live", "test", "test"):
            enrol_somebody(database, mode)
    for number, (words, count) in enumerate(
        (([], 3), (["--mode", "live"], 1), (["--version", "v1", "--study", "sakai2021"], 3), (["--mode", "bot"], 0))
    ):
        folder = tmp_path / str(number)
        assert run(instance, "export", str(folder), *words).returncode == 0
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        assert manifest["files"][data_name("participants.csv")]["rows"] == count
        assert manifest["with_free_text"] is False
    refused = run(instance, "export", str(tmp_path / "never"), "--mode", "dead")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "'dead' is not one of" in refused.stderr


def test_a_recruiters_list_is_compared_with_whom_it_sent(instance: Path, tmp_path: Path) -> None:
    file = tmp_path / "list.csv"
    file.write_text("Participant id,Status\n77,APPROVED\n78,RETURNED\n", encoding="utf-8")
    with open_database(place(instance)) as database:
        code = enrol_somebody(database, "live", recruit=Recruit("sona", "77")).code
    differs = run(instance, "reconcile", str(file))
    assert (differs.returncode, differs.stderr) == (1, "")
    assert differs.stdout == (
        "In the file: 2; here: 1; in agreement: 0.\n\n"
        "Paid and not complete here (1): they got paid, and did not send the last page\n"
        f"  77 · {code} · in progress here, APPROVED\n"
    )
    as_json = run(instance, "reconcile", str(file), "--json")
    assert [one["external_id"] for one in json.loads(as_json.stdout)["findings"]["paid_incomplete"]] == ["77"]
    file.write_text("Participant id,Status\n77,RETURNED\n", encoding="utf-8")
    agrees = run(instance, "reconcile", str(file))
    assert (agrees.returncode, agrees.stdout) == (0, "In the file: 1; here: 1; in agreement: 1.\n")
    file.write_text("Name\nAnn\n", encoding="utf-8")
    refused = run(instance, "reconcile", str(file))
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
    assert refused.stderr.startswith("xar: the file has no column of people's ids; wanted: Participant id")
    nowhere = run(instance, "reconcile", str(tmp_path / "missing.csv"))
    assert nowhere.stderr == f"xar: {tmp_path}/missing.csv: No such file or directory\n"


@pytest.mark.sqlite_only(reason="it begins without SQLite's file")
def test_recruits_are_written_by_a_verb_of_their_own_and_overwrite_nothing(instance: Path, tmp_path: Path) -> None:
    file = tmp_path / "recruits.csv"
    missing = run(instance, "recruits", str(file))
    assert (missing.returncode, file.exists()) == (2, False)
    assert missing.stderr.startswith("xar: there is no database")
    assert missing.stderr.count("\n") == 1
    with open_database(place(instance)) as database:
        enrol_somebody(database, recruit=Recruit("sona", "77"))
    done = run(instance, "recruits", str(file))
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{file}: 1 row\n", "")
    assert file.read_text(encoding="utf-8").splitlines()[1].endswith(",sona,77,,,in_progress")
    again = run(instance, "recruits", str(file))
    assert again.returncode == 2
    assert again.stderr == f"xar: {file} exists already; choose another file\n"
    nowhere = run(instance, "recruits", str(tmp_path / "missing" / "recruits.csv"))
    assert nowhere.returncode == 2
    assert nowhere.stderr == f"xar: {tmp_path}/missing/recruits.csv: No such file or directory\n"


def test_answers_survive_a_server_that_is_killed(instance: Path) -> None:
    with serving(instance) as server:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
        headers = {"Content-Type": "application/x-www-form-urlencoded", "Sec-Fetch-Site": "same-origin"}
        connection.request("POST", "/consent", "agree=yes", headers)
        assert connection.getresponse().status == 303
        server.process.kill()
        connection.close()
    assert ask(instance, "SELECT count(*) FROM participants") == [(1,)]
    if place(instance).database_url is None:
        assert ask(instance, "PRAGMA integrity_check") == [("ok",)]
    with serving(instance) as server:
        assert get(server.port, "/healthz")[0] == 200


def test_browsers_that_keep_their_connections_open_keep_nobody_out(instance: Path) -> None:
    with serving(instance) as server, ExitStack() as opened:
        for _ in range(150):
            opened.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=10))
        newcomer = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
        newcomer.request("GET", "/")
        assert newcomer.getresponse().status == 200
        newcomer.close()
