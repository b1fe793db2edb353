"""The files of deploy/: what tools find in them, what the services may do, and that they fit the program."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from tests.conftest import ROOT
from tests.web.bundles import read_study, write_bundle
from tests.web.edge import check, lay_out
from tests.web.servers import environment, serving
from webapp import app
from webapp.command_line import CommandError
from webapp.views.security import HEADERS

DEPLOY = ROOT / "deploy"
COMPOSE = ("compose.yaml", "compose.sqlite.yaml")
SERVICES = ("xar.service", "xar-backup.service")
SHELL = ("docker/xar", "systemd/xarctl")
MOST_EXPOSED = 15
"""In tenths, of the 100 that systemd gives a service without any protection."""


def tool(name: str, *words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a tool of this environment, or one of the system."""
    beside = Path(sys.executable).with_name(name)
    program = str(beside) if beside.exists() else shutil.which(name)
    assert program is not None, f"{name} is missing; `make install-browser` installs Debian's as root"
    return subprocess.run([program, *map(str, words)], capture_output=True, text=True, timeout=60, check=False)


def changed(folder: Path, source: str, old: str, new: str) -> Path:
    """Write a file of deploy/ with a fault that a tool has to find."""
    text = (DEPLOY / source).read_text(encoding="utf-8")
    assert old in text
    path = folder / Path(source).name
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def compose(name: str) -> Mapping[str, Any]:
    loaded: Mapping[str, Any] = YAML(typ="safe").load(DEPLOY / name)
    return loaded


def test_compose_files_keep_to_the_specification(tmp_path: Path) -> None:
    words = ("--builtin-schema", "vendor.compose-spec")
    assert tool("check-jsonschema", *words, *(DEPLOY / name for name in COMPOSE)).returncode == 0
    wrong = changed(tmp_path, COMPOSE[0], "cap_drop: [ALL]", "cap_drop: ALL")
    assert tool("check-jsonschema", *words, wrong).returncode == 1


def test_a_linter_finds_nothing_in_the_dockerfile(tmp_path: Path) -> None:
    done = tool("hadolint", DEPLOY / "Dockerfile")
    assert (done.returncode, done.stdout) == (0, "")
    assert tool("hadolint", changed(tmp_path, "Dockerfile", "python:3.12-slim", "python")).returncode == 1


@pytest.mark.parametrize("name", SHELL)
def test_a_linter_finds_nothing_in_shell_scripts(name: str, tmp_path: Path) -> None:
    done = tool("shellcheck", DEPLOY / name)
    assert (done.returncode, done.stdout) == (0, "")
    assert tool("shellcheck", changed(tmp_path, name, '"$@"', "$@")).returncode == 1


def test_nginx_and_a_checker_of_its_configuration_find_nothing(tmp_path: Path) -> None:
    lay_out(tmp_path / "ours", 18080, 18443, [18000])
    tested = check(tmp_path / "ours")
    assert tested.returncode == 0
    assert "warn" not in tested.stderr
    assert tool("gixy", tmp_path / "ours/nginx.conf").returncode == 0
    lay_out(
        tmp_path / "bad",
        18080,
        18443,
        [18000],
        {"proxy_set_header Host $server_name;": "proxy_set_header Host $http_host;"},
    )
    assert tool("gixy", tmp_path / "bad/nginx.conf").returncode == 1


def test_systemd_understands_the_units_and_finds_them_closed(tmp_path: Path) -> None:
    (tmp_path / "xar").write_text("#!/bin/sh\n", encoding="utf-8")
    (tmp_path / "xar").chmod(0o755)
    for path in (DEPLOY / "systemd").glob("xar*.*"):
        text = path.read_text(encoding="utf-8").replace("/opt/xar/.venv/bin/xar", str(tmp_path / "xar"))
        (tmp_path / path.name).write_text(text, encoding="utf-8")
    units = [tmp_path / name for name in (*SERVICES, "xar-backup.timer")]
    done = tool("systemd-analyze", "verify", "--man=no", *units)
    assert (done.returncode, done.stderr) == (0, "")
    words = ("security", "--no-pager", "--offline=true", f"--threshold={MOST_EXPOSED}")
    for unit in units[:2]:
        assert tool("systemd-analyze", *words, unit).returncode == 0
        open_unit = tmp_path / f"open-{unit.name}"
        open_unit.write_text(re.sub("(?m)^(Protect|System).*", "", unit.read_text(encoding="utf-8")), encoding="utf-8")
        assert tool("systemd-analyze", *words, open_unit).returncode != 0


def test_both_services_are_closed_in_the_same_way() -> None:
    first, second = (_hardening(name) for name in SERVICES)
    assert first >= {"ProtectSystem=strict", "NoNewPrivileges=yes", "CapabilityBoundingSet=", "StateDirectoryMode=0700"}
    assert first == second


@pytest.mark.parametrize("name", COMPOSE)
def test_containers_can_do_and_be_reached_by_as_little_as_possible(name: str) -> None:
    found = compose(name)
    services: Mapping[str, Mapping[str, Any]] = found["services"]
    for service, given in services.items():
        assert given["read_only"] is True, service
        assert given["cap_drop"] == ["ALL"], service
        assert given["security_opt"] == ["no-new-privileges:true"], service
        assert ("ports" in given) == (service == "nginx"), service
        assert "cap_add" not in given or service in {"nginx", "database"}, service
    assert all(network is None or network["internal"] for network in found["networks"].values())
    reached = {service for service, given in services.items() if "outside" in given["networks"]}
    assert reached == {"nginx"}
    restarts = {service: given["restart"] for service, given in services.items()}
    once = {"migrate": "no", "build": "no"}
    assert restarts == {service: once.get(service, "unless-stopped") for service in services}


@pytest.mark.parametrize("name", [*COMPOSE, "systemd/xar.env", *(f"systemd/{name}" for name in SERVICES)])
def test_every_setting_is_one_that_something_reads(name: str) -> None:
    text = re.sub(r"(?m)^ +#.*", "", (DEPLOY / name).read_text(encoding="utf-8"))
    given = set(re.findall(r"(?m)(?:^|[ =#])((?:XAR_[A-Z_]+|DATABASE_URL)(?==|: ))", text))
    programs = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "webapp").rglob("*.py"))
    units = (DEPLOY / "systemd/xar.service").read_text(encoding="utf-8").partition("ExecStart=")[2].splitlines()[0]
    images = (DEPLOY / "docker/xar").read_text(encoding="utf-8")
    assert given
    for setting in given:
        assert f"`{setting}`" in programs or f'"{setting}"' in programs or setting in units + images, setting


def test_both_editions_have_the_same_nginx_and_asked_for_settings_are_in_the_example() -> None:
    first, second = (compose(name)["services"] for name in COMPOSE)
    assert first["nginx"] == second["nginx"]
    asked = {word for name in COMPOSE for word in re.findall(r"\$\{(\w+)", (DEPLOY / name).read_text(encoding="utf-8"))}
    assert asked == set(re.findall(r"(?m)^(\w+)=", (DEPLOY / "compose/example.env").read_text(encoding="utf-8")))


def test_the_address_of_the_program_is_the_one_that_nginx_asks() -> None:
    upstream = (DEPLOY / "compose/xar-upstream.conf").read_text(encoding="utf-8")
    for name in COMPOSE:
        found = compose(name)
        address = found["services"]["app"]["networks"]["edge"]["ipv4_address"]
        assert f"server {address}:8000;" in upstream
        assert address.startswith(found["networks"]["edge"]["ipam"]["config"][0]["subnet"].rpartition(".")[0])


def test_a_server_without_torch_is_well_and_says_so_under_its_own_name_alone(tmp_path: Path) -> None:
    write_bundle(tmp_path / "instance", read_study())
    (tmp_path / "without").mkdir()
    for name in ("torch", "safetensors"):
        (tmp_path / f"without/{name}.py").write_text("raise ImportError('not in this image')\n", encoding="utf-8")
    names = "study.example.org, other.example.org"
    given = {"PYTHONPATH": str(tmp_path / "without"), "XAR_TRUSTED_HOSTS": names}
    with serving(tmp_path / "instance", **given) as server:
        assert _health(server.port, XAR_TRUSTED_HOSTS=names) == 0
        assert _health(server.port, XAR_TRUSTED_HOSTS="unknown.example.org") == 1
        server.stop()
        assert _health(server.port, XAR_TRUSTED_HOSTS=names) == 1


def test_a_container_hands_the_password_on_from_a_file(tmp_path: Path) -> None:
    script = changed(tmp_path, "docker/xar", "/opt/xar/bin/xar", "printenv")
    (tmp_path / "password").write_text("p@ss:w/ rd\n", encoding="utf-8")
    given = {"PATH": os.defpath, "XAR_DATABASE_PASSWORD_FILE": str(tmp_path / "password")}
    done = subprocess.run(["/bin/sh", script, "PGPASSWORD"], env=given, capture_output=True, text=True, check=False)
    assert done.stdout == "p@ss:w/ rd\n"
    given["XAR_DATABASE_PASSWORD_FILE"] = str(tmp_path / "none")
    assert subprocess.run(["/bin/sh", script, "PATH"], env=given, capture_output=True, check=False).returncode != 0


def test_a_verb_gets_the_settings_as_systemd_reads_them(tmp_path: Path) -> None:
    url = "postgresql://xar:p$a`id`'s@db.example.org/xar?sslmode=verify-full&sslrootcert=/etc/xar/a b.pem"
    done = _xarctl(
        tmp_path,
        f"# $(touch {tmp_path}/ran)\n; also a comment\n\nDATABASE_URL={url} \n"
        'XAR_SERVE_OPTIONS="--live --workers 2"\n  XAR_STUDY = \'a & "b"\'\n'
        'XAR_TITLE=""\nXAR_HTTPS=yes # kept\nXAR_LAST=$HOME',
    )
    assert (done.returncode, done.stderr) == (0, "")
    given = dict(word.split("=", 1) for word in done.stdout.split("\0") if word)
    read = {name: value for name, value in given.items() if name.startswith(("XAR", "DATABASE"))}
    assert read == {
        "XARCTL_SETTINGS": str(tmp_path / "xar.env"),
        "XAR_INSTANCE": "/var/lib/xar",
        "XAR_BACKUPS": "/var/backups/xar",
        "DATABASE_URL": url,
        "XAR_SERVE_OPTIONS": "--live --workers 2",
        "XAR_STUDY": 'a & "b"',
        "XAR_TITLE": "",
        "XAR_HTTPS": "yes # kept",
        "XAR_LAST": "$HOME",
    }
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "line", ["export A=1", "A", "=1", "1A=1", 'A="1', "A='1", 'A="1"2', "A='1''2'", "A=1\\2", "A=1\\", "# a comment\\"]
)
def test_a_verb_refuses_settings_that_systemd_would_read_otherwise(line: str, tmp_path: Path) -> None:
    done = _xarctl(tmp_path, f"XAR_STUDY=sakai2021\n{line}\nXAR_HTTPS=yes\n")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"xarctl: {tmp_path}/xar.env, line 2: ")


def test_a_verb_without_settings_does_not_run(tmp_path: Path) -> None:
    done = _xarctl(tmp_path, None)
    assert done.returncode != 0
    assert done.stdout == ""


def test_a_refusal_stops_the_start_and_anything_else_starts_again() -> None:
    unit = (DEPLOY / "systemd/xar.service").read_text(encoding="utf-8").splitlines()
    assert {"Restart=always", f"RestartPreventExitStatus={CommandError.exit_code}"} <= set(unit)


def test_nginx_and_the_program_agree() -> None:
    snippets = {path.stem: path.read_text(encoding="utf-8") for path in (DEPLOY / "nginx/snippets").iterdir()}
    own = dict(re.findall(r'(?m)^add_header (\S+) "(.*)" always;', snippets["xar-own-answers"]))
    same = {name: value for name, value in HEADERS.items() if name != "Content-Security-Policy"}
    assert own.items() >= same.items()
    assert f"client_max_body_size {app.MAX_BODY_BYTES // 1024}k;" in snippets["xar-server"]
    kept = re.search(r"keepalive_timeout (\d+)s;", snippets["xar-upstream"])
    assert kept is not None
    assert int(kept[1]) < app._IDLE_S


def test_the_page_about_nginx_tells_the_numbers_of_its_configuration() -> None:
    page = (ROOT / "docs/deploying-nginx.md").read_text(encoding="utf-8")
    site, limits, server = (
        (DEPLOY / "nginx" / name).read_text(encoding="utf-8")
        for name in ("xar.conf", "snippets/xar-limits.conf", "snippets/xar-server.conf")
    )
    rows = re.findall(r"(?m)^\| [^|]+ \| ([\d,]+) \| (?:(\d+) a (minute|second))? ?\| (`\S+`|everywhere) \|$", page)
    told = {where: (int(burst.replace(",", "")), rate, unit[:1]) for burst, rate, unit, where in rows if rate}
    rates = {zone: (rate, unit) for zone, rate, unit in re.findall(r"zone=(\w+):\S+ rate=(\d+)r/(\w);", limits)}
    places = {"everywhere": site.partition("    location / {\n        include")[0]} | {
        f"`{path}`": body for path, body in re.findall(r"location = (\S+) \{(.*?)\}", site, re.DOTALL)
    }
    counted = {where: re.findall(r"limit_req zone=(\w+) burst=(\d+) nodelay;", body) for where, body in places.items()}
    assert told == {where: (int(found[0][1]), *rates[found[0][0]]) for where, found in counted.items()}
    connections = re.findall(r"limit_conn xar_connections (\d+);", site)
    assert [burst for burst, rate, *_ in rows if not rate] == connections
    (body,) = re.findall(r"client_max_body_size (\d+)k;", server)
    (pause,) = re.findall(r"client_body_timeout (\d+)s;", server)
    assert f"{body} kB at most (413), {pause} seconds for each pause" in page


def settings() -> Mapping[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _health(port: int, **given: str) -> int:
    asked = [sys.executable, "-I", str(DEPLOY / "docker/healthcheck.py")]
    env = {**environment(ROOT), "XAR_PORT": str(port), **given}
    return subprocess.run(asked, env=env, capture_output=True, check=False).returncode


def _xarctl(folder: Path, settings: str | None) -> subprocess.CompletedProcess[str]:
    """Run xarctl as if by root, and print the environment in place of the verb."""
    text = (DEPLOY / "systemd/xarctl").read_text(encoding="utf-8")
    text, verbs = re.subn(r'(?m)^exec setpriv .*/xar "\$@"$', "exec env --null", text)
    assert verbs == 1
    script = folder / "xarctl"
    script.write_text(text.replace('"$(id -u)"', "0"), encoding="utf-8")
    if settings is not None:
        (folder / "xar.env").write_text(settings, encoding="utf-8")
    given = {"PATH": os.defpath, "XARCTL_SETTINGS": str(folder / "xar.env")}
    return subprocess.run(["/bin/sh", script], env=given, capture_output=True, text=True, check=False, timeout=60)


def _hardening(name: str) -> set[str]:
    lines = (DEPLOY / "systemd" / name).read_text(encoding="utf-8").partition("StateDirectory=")[2].splitlines()
    return {line for line in lines if re.match(r"[A-Z]\w+=", line)} - {
        "ReadWritePaths=/var/backups/xar",
        "WantedBy=multi-user.target",
    }
