"""`xar backup`, `xar restore`, `xar migrate`: data that are kept, brought back, and carried to a new version of xar."""

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from webapp.command_line import CommandError, refusals, show_json

if TYPE_CHECKING:
    from webapp.config import Config
    from webapp.storage.backup_manifests import Manifest
    from webapp.storage.restoring import Restored

POSTGRESQL_SUFFIX = ".pgdump"


@click.command()
@click.option(
    "--to",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Where it goes; better another disk (XAR_BACKUPS, else `backups` in the instance).",
)
@click.option("--with-secret-key", is_flag=True, help="Also copy the secret key, into a file beside it.")
@click.option("--keep-daily", type=click.IntRange(0), metavar="N", help="Afterwards keep the last of N days only.")
@click.option("--keep-weekly", type=click.IntRange(0), metavar="N", help="And the last of N weeks.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def backup(
    folder: Path | None, keep_daily: int | None, keep_weekly: int | None, *, with_secret_key: bool, as_json: bool
) -> None:
    """Copy the database, while the server serves, with a manifest that says what it holds; nothing is overwritten.

    The bundles that its data need are kept in `bundles` beside it. With --keep-daily or --keep-weekly, what
    `xar backup` made earlier of this database is removed, except the newest of so many days and weeks.
    """
    from webapp.config import read_config
    from webapp.storage.backups import remove_expendable

    with refusals():
        config = read_config(os.environ)
        folder = backup_folder(config) if folder is None else folder
        path, manifest = _back_up(config, folder, with_secret_key=with_secret_key)
        removed = []
        if keep_daily is not None or keep_weekly is not None:
            removed = remove_expendable(folder, manifest.database, keep_daily or 0, keep_weekly or 0)
    if as_json:
        show_json({"file": str(path), "removed": [str(one) for one in removed], "manifest": manifest.to_json()})
        return
    click.echo(f"Backup: {path} ({_size(manifest.num_bytes)}, {_people(manifest)})")
    click.echo(f"Head:   record {manifest.head.number}, {manifest.head.hash}")
    click.echo(f"SHA-256 {manifest.sha256}")
    if manifest.missing_bundles:
        click.echo(f"Not there, so not kept: the bundles {', '.join(manifest.missing_bundles)}")
    if not with_secret_key:
        click.echo("The secret key is not in it; keep it too (once is enough): --with-secret-key")
    for one in removed:
        click.echo(f"Removed: {one}")


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--verify", "is_check", is_flag=True, help="Check the backup and change nothing.")
@click.option("--replace", is_flag=True, help="Even if the database holds data; it is kept under another name.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def restore(file: Path, *, is_check: bool, replace: bool, as_json: bool) -> None:
    """Take the backup FILE into use, where no server runs and the database holds no data.

    Digest, damage, number of rows, the chain of records and every row that it vouches for are checked before. With
    --verify that is all; exit status 1 means that something is wrong.
    """
    from webapp.config import read_config

    with refusals():
        config = read_config(os.environ)
        if is_check:
            _verify(file, config, as_json=as_json)
            return
        done = _restore(file, config, replace=replace)
    if as_json:
        kept = None if done.kept is None else str(done.kept)
        told = {"restored": str(file), "kept": kept, "has_secret_key": done.has_key}
        show_json(told | {"manifest": done.manifest.to_json()})
        return
    _tell_restored(file, done)


@click.command()
@click.option("--no-backup", is_flag=True, help="Do not back up first.")
def migrate(*, no_backup: bool) -> None:
    """Bring the database's tables to this version of xar, all or nothing, with a backup before.

    No server may run on the instance.
    """
    from webapp.config import read_config
    from webapp.storage.migrating import migrate as bring_up_to_date

    with refusals():
        config = read_config(os.environ)
        folder = None if no_backup else backup_folder(config)
        done = bring_up_to_date(config.database_path, folder, datetime.now(UTC), url=config.database_url)
    if done.backup is not None:
        click.echo(f"Backup: {done.backup}")
    if done.before == done.after:
        click.echo(f"The tables are at revision {done.after} already. Nothing was done.")
    elif done.before is None:
        click.echo(f"Made the tables, at revision {done.after}.")
    else:
        click.echo(f"Brought the tables from revision {done.before} to {done.after}.")


def backup_folder(config: "Config") -> Path:
    """Return where backups go unless told otherwise."""
    return config.backup_folder


def _back_up(config: "Config", folder: Path, *, with_secret_key: bool) -> "tuple[Path, Manifest]":
    from webapp.storage.backups import back_up
    from webapp.storage.database import open_database
    from webapp.storage.postgres_dumps import dump

    key = config.instance / "secret_key"
    if with_secret_key and not key.exists():
        raise CommandError(f"there is no secret key {key} to keep; the first `xar serve` makes it")
    now = datetime.now(UTC)
    if config.database_url is None:
        return back_up(config.database_path, folder, now, with_secret_key=with_secret_key)
    with open_database(config, make=False) as database:
        return dump(database, folder, now, with_secret_key=with_secret_key)


def _restore(file: Path, config: "Config", *, replace: bool) -> "Restored":
    from webapp.storage.postgres_dumps import restore_dump
    from webapp.storage.restoring import restore as take_into_use

    if file.suffix == POSTGRESQL_SUFFIX:
        return restore_dump(file, config.database_path, _url(config))
    if config.database_url is not None:
        raise CommandError(f"{file} is of SQLite, and DATABASE_URL names a PostgreSQL database; unset it")
    return take_into_use(file, config.database_path, datetime.now(UTC), replace=replace)


def _url(config: "Config") -> str:
    if config.database_url is None:
        raise CommandError("this is a backup of PostgreSQL; set DATABASE_URL to a database on the server to use")
    return config.database_url


def _verify(file: Path, config: "Config", *, as_json: bool) -> None:
    from webapp.storage.postgres_dumps import verify_dump
    from webapp.storage.restoring import verify

    if file.suffix == POSTGRESQL_SUFFIX:
        manifest, problems = verify_dump(file, _url(config))
    else:
        manifest, problems = verify(file, config.instance)
    if as_json:
        told = None if manifest is None else manifest.to_json()
        show_json({"file": str(file), "problems": problems, "manifest": told})
    elif manifest is not None and not problems:
        num_rows, num_people = sum(manifest.num_rows.values()), manifest.num_rows.get("participants", 0)
        click.echo(f"Backup of {manifest.made_at:%Y-%m-%d %H:%M:%S} UTC by xar {manifest.program}: all is as it was.")
        click.echo(f"{num_rows} rows, {num_people} participants")
        click.echo(f"Head: record {manifest.head.number}, {manifest.head.hash}")
    else:
        for problem in problems:
            click.echo(problem, err=True)
    if problems:
        raise click.exceptions.Exit(1)


def _tell_restored(file: Path, done: "Restored") -> None:
    click.echo(f"Restored {file}, made {done.manifest.made_at:%Y-%m-%d %H:%M:%S} UTC.")
    click.echo(f"Head: record {done.manifest.head.number}, {done.manifest.head.hash}")
    if done.kept is not None:
        click.echo(f"The database that was there is kept: {done.kept}")
    if not done.has_key:
        click.echo("There is no secret key; a new one will be made. Recruiters' links will lead to new participants.")
    if done.is_same_key is False:
        click.echo("The instance keeps its secret key, which is another one than the backup's.")
    click.echo("What was answered after the backup is asked again. Look at `xar doctor`, then `xar serve`.")


def _people(manifest: "Manifest") -> str:
    number = manifest.num_rows.get("participants", 0)
    return f"{number} participant{'' if number == 1 else 's'}"


def _size(num_bytes: int) -> str:
    return f"{num_bytes / 10**6:.1f} MB" if num_bytes >= 10**6 else f"{-(-num_bytes // 1000)} kB"
