"""`xar verify-log`, `xar study replay`: proofs that nothing was changed; `xar erase`: the wish to be forgotten."""

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import click

from webapp.command_line import refusals, show_json


@click.command("verify-log")
@click.option("--head", metavar="NUMBER:HASH", help="A head that was noted down before; the log must still contain it.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def verify_log(head: str | None, *, as_json: bool) -> None:
    """Check the chain of records, and every row that it vouches for. Exit status 1 means that something was changed."""
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.verification import verify_log as verify

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        found = verify(database, known=_head(head))
    told = {"records": found.head.number, "head": found.head.hash, "erased": found.num_erased}
    lines = [f"Records: {found.head.number}, head {found.head.hash}"]
    if found.num_erased:
        lines.append(f"About people who were erased, so that only the chain can be checked: {found.num_erased}")
    if found.num_unvouched:
        lines.append(f"Participants from before the log was kept, for whom it does not vouch: {found.num_unvouched}")
    lines.append("Something was changed." if found.problems else "Everything is as it was recorded.")
    _tell(told | {"unvouched_participants": found.num_unvouched}, lines, found.problems, as_json=as_json)


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def replay(*, as_json: bool) -> None:
    """Draw every assignment again from the allocation ledger. Exit status 1 means that one cannot be reproduced."""
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.replay import replay as draw_again

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        found = draw_again(database)
    again = found.num_allocations - found.num_before
    lines = [f"Allocations: {found.num_allocations}; drawn again from their words and the counts before: {again}"]
    if found.num_before:
        lines.append(f"From before the ledger, counted and not drawn again: {found.num_before}")
    lines.append("The ledger does not add up." if found.problems else "Every assignment is reproduced.")
    told = {"allocations": found.num_allocations, "from_before_the_ledger": found.num_before}
    _tell(told, lines, found.problems, as_json=as_json)


@click.command()
@click.argument("code")
@click.option("--yes", is_flag=True, help="Do not ask.")
def erase(code: str, *, yes: bool) -> None:
    """Withdraw the participant CODE and erase every row of theirs, for good.

    The log keeps salted digests, which say nothing without what was erased. Files exported before are not touched.
    """
    from webapp.config import read_config
    from webapp.storage.database import open_database
    from webapp.storage.erasure import erase as erase_person
    from webapp.storage.people import find_person
    from webapp.storage.records import COMMAND_LINE

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        find_person(database, code)
        if not yes:
            click.confirm(f"Erase everything of participant {code!r}, for good?", abort=True)
        is_gone = erase_person(database, code, COMMAND_LINE, datetime.now(UTC))
        last_traces = database.edition.last_traces
    click.echo(f"Participant {code!r} is erased. Delete their rows from files that were exported before.")
    if not is_gone:
        click.echo(last_traces)


def _tell(told: Mapping[str, object], lines: Sequence[str], problems: Sequence[str], *, as_json: bool) -> None:
    """Say what a proof found, to a program or to a person, and exit with 1 if it failed."""
    if as_json:
        show_json({**told, "problems": list(problems)})
    else:
        for problem in problems:
            click.echo(problem, err=True)
        for line in lines:
            click.echo(line)
    if problems:
        raise click.exceptions.Exit(1)


def _head(text: str | None) -> tuple[int, str] | None:
    if text is None:
        return None
    number, _, digest = text.partition(":")
    if not number.isdecimal() or len(digest) != 64 or set(digest) - set("0123456789abcdef"):  # noqa: PLR2004 - SHA-256
        raise click.BadParameter(f"{text!r} is no head; use NUMBER:HASH as the dashboard and exports show it")
    return int(number), digest
