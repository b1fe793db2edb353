"""`xar doctor`: whether data are safe here, a line for each thing that was looked at."""

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import click

from webapp.command_line import refusals, show, show_json
from webapp.commands.operating import backup_folder

if TYPE_CHECKING:
    from rich.console import RenderableType

    from webapp.config import Config
    from webapp.storage.findings import Finding

_STYLES = {"ok": "green", "warning": "yellow", "problem": "bold red"}


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def doctor(*, as_json: bool) -> None:
    """Check program, database, instance folder, machine, settings and backups, with or without a running server.

    Exit status 1 means that there is a problem; warnings do not count.
    """
    from webapp.config import read_config

    with refusals():
        found = _findings(read_config(os.environ))
    num_problems = sum(finding.status == "problem" for finding in found)
    if as_json:
        show_json({"problems": num_problems, "findings": [finding.to_json() for finding in found]})
    else:
        show(_table(found), _summary(found))
    if num_problems:
        raise click.exceptions.Exit(1)


def _findings(config: "Config") -> "list[Finding]":
    from webapp.config import LOOPBACK
    from webapp.storage.findings import Finding
    from webapp.storage.health import database_findings
    from webapp.storage.instance import running_server
    from webapp.storage.surroundings import folder_findings, settings_findings

    settings = settings_findings(
        host=config.host,
        is_local=config.host in LOOPBACK,
        https=config.https,
        trusted_hosts=config.trusted_hosts,
    )
    if not config.instance.is_dir():
        wish = "`xar build` makes one; XAR_INSTANCE says where it is"
        return [Finding("instance", "problem", f"there is no folder {config.instance}", wish), *settings]
    address = running_server(config.instance)
    server = Finding("server", "ok", "none runs" if address is None else f"runs at {address}")
    # The folder comes first: to open the database works in what is left behind.
    return [
        server,
        *folder_findings(
            config.database_path, is_served=address is not None, holds_answers=config.database_url is None
        ),
        *database_findings(config.database_path, config.database_url, backup_folder(config), datetime.now(UTC)),
        *settings,
    ]


def _table(found: "Sequence[Finding]") -> "RenderableType":
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for finding in found:
        told = Text(finding.told)
        if finding.wish:
            told.append(f"\n-> {finding.wish}", style="italic")
        table.add_row(Text(finding.status, style=_STYLES[finding.status]), finding.check, told)
    return table


def _summary(found: "Sequence[Finding]") -> str:
    problems = sum(finding.status == "problem" for finding in found)
    warnings = sum(finding.status == "warning" for finding in found)
    if not problems and not warnings:
        return "\nAll is well."
    return f"\nProblems: {problems}, warnings: {warnings}."
