"""The settings of one running program, read once."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

DEFAULT_STUDY = "sakai2021"
_MAX_PORT = 65535
_MAX_WORKERS = 64
_POSTGRES = ("postgres", "postgresql", "postgresql+psycopg")
LOOPBACK = ("localhost", "127.0.0.1", "::1")
"""The names of this machine for itself."""

_TRUSTED_ON_LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
_YES_OR_NO = {"1": True, "yes": True, "true": True, "0": False, "no": False, "false": False}


class ConfigError(ValueError):
    """Settings that cannot be used.

    Attributes:
        problems: One for each setting that is wrong.
    """

    def __init__(self, *problems: str) -> None:
        self.problems = problems
        super().__init__("; ".join(problems))


@dataclass(frozen=True, slots=True)
class Config:
    """Where the program keeps its things, what it serves, and to whom.

    Attributes:
        instance: The folder of database, secrets and bundles. `XAR_INSTANCE`, else `instance` in the working folder.
        study: The name of the study that is served. `XAR_STUDY`.
        live: Whether the answers are real data. Never from the environment: it is said by whoever starts the server.
        host: The address to listen on. `XAR_HOST`, else this machine alone.
        port: The port to listen on, 0 for any that is free. `XAR_PORT`.
        https: Whether participants reach the server by https, through a proxy. Cookies are then sent by https alone.
            `XAR_HTTPS`.
        trusted_hosts: The names under which the server may be addressed; empty for all. `XAR_TRUSTED_HOSTS`, separated
            by commas, else the names of this machine where it listens to this machine alone, else all.
        access_log: Whether to write a line for each request, with nothing about who asked. `XAR_ACCESS_LOG`.
        database_url: The address of the PostgreSQL database, `DATABASE_URL`; None for SQLite's file in the instance.
        workers: How many processes serve; with SQLite one. `WEB_CONCURRENCY`.
        backups: The folder of backups. `XAR_BACKUPS`, else `backups` in the instance.
    """

    instance: Path
    study: str = DEFAULT_STUDY
    live: bool = False
    host: str = "127.0.0.1"
    port: int = 8000
    https: bool = False
    trusted_hosts: tuple[str, ...] = _TRUSTED_ON_LOOPBACK
    access_log: bool = False
    database_url: str | None = field(default=None, repr=False)  # It may hold a password.
    workers: int = 1
    backups: Path | None = None

    @property
    def mode(self) -> Literal["live", "test"]:
        """The column `mode` of the data."""
        return "live" if self.live else "test"

    @property
    def database_path(self) -> Path:
        """The database file of the SQLite edition."""
        return self.instance / "xar.sqlite3"

    @property
    def backup_folder(self) -> Path:
        """Where backups go and are looked for unless a command says otherwise."""
        return self.backups or self.instance / "backups"


def _address_problems(database_url: str | None) -> list[str]:
    """Return what is wrong with an address; only what comes before the name and the password is repeated."""
    if database_url is None or database_url.partition("://")[0] in _POSTGRES:
        return []
    kind = re.match("[a-zA-Z0-9+]{1,20}://", database_url)
    told = f"begins with {kind[0]!r}" if kind else "is no address"
    return [f"DATABASE_URL {told}; use postgresql://name:password@host/database, or remove it for SQLite"]


def read_config(environment: Mapping[str, str], *, live: bool = False, **given: str | int | None) -> Config:
    """Read the settings: what is given on the command line, else from the environment, else the defaults.

    Args:
        environment: Such as `os.environ`.
        live: Whether the answers are real data.
        given: Settings by the name of `Config`'s attribute; None for not given.

    Raises:
        ConfigError: Settings cannot be used; all of them are named.
    """
    problems: list[str] = []

    def setting(name: str, default: str) -> str:
        value = given.get(name)
        return environment.get(f"XAR_{name.upper()}", default) if value is None else str(value)

    port, https = setting("port", "8000"), setting("https", "no").lower()
    if not re.fullmatch("[0-9]{1,5}", port) or int(port) > _MAX_PORT:
        problems.append(f"XAR_PORT or --port is {port!r}; use a number from 0 to {_MAX_PORT}")
    access_log = setting("access_log", "no").lower()
    switches = (("HTTPS", https), ("ACCESS_LOG", access_log))
    problems += [f"XAR_{name} is {value!r}; use yes or no" for name, value in switches if value not in _YES_OR_NO]
    database_url = environment.get("DATABASE_URL") or None
    problems += _address_problems(database_url)
    told_workers = given.get("workers")
    workers = environment.get("WEB_CONCURRENCY") or "1" if told_workers is None else str(told_workers)
    if not re.fullmatch("[0-9]{1,3}", workers) or not 1 <= int(workers) <= _MAX_WORKERS:
        problems.append(f"WEB_CONCURRENCY or --workers is {workers!r}; use a number from 1 to {_MAX_WORKERS}")
    host, study, instance = (
        setting("host", "127.0.0.1"),
        setting("study", DEFAULT_STUDY),
        setting("instance", "instance"),
    )
    for name, value in (("HOST", host), ("INSTANCE", instance)):
        if not value.strip():
            problems.append(f"XAR_{name} is empty; set it or remove it")
    if not re.fullmatch("[a-z0-9][a-z0-9_-]*", study):
        problems.append(f"XAR_STUDY or --study is {study!r}; use the name of a study, not a path")
    default_hosts = ",".join(_TRUSTED_ON_LOOPBACK) if host in LOOPBACK else ""
    trusted = [name.strip() for name in setting("trusted_hosts", default_hosts).split(",")]
    if problems:
        raise ConfigError(*problems)
    return Config(
        instance=Path(instance).absolute(),
        study=study,
        live=live,
        host=host,
        port=int(port),
        https=_YES_OR_NO[https],
        trusted_hosts=tuple(name for name in trusted if name),
        access_log=_YES_OR_NO[access_log],
        database_url=database_url,
        workers=int(workers),
        backups=Path(environment["XAR_BACKUPS"]).absolute() if environment.get("XAR_BACKUPS") else None,
    )
