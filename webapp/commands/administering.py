"""`xar admin`: the accounts of researchers, what they may do, and which browsers are signed in."""

import os
from datetime import UTC, datetime

import click

from webapp.command_line import refusals

ROLES = ("viewer", "owner", "admin")
"""As in `webapp.storage.researchers`, which is loaded only when a verb runs."""

role_option = click.option(
    "--role",
    type=click.Choice(ROLES),
    default="owner",
    help="viewer: look on while the arms are masked; owner: everything with the study; admin: accounts too.",
)


@click.group()
def admin() -> None:
    """Manage the accounts of researchers."""


@admin.command()
@click.argument("name")
@role_option
@click.option("--generate-password", is_flag=True, help="Make a random password and print it, once.")
@click.option("--if-missing", is_flag=True, help="Do nothing if there is such an account.")
def create(name: str, role: str, *, generate_password: bool, if_missing: bool) -> None:
    """Make an account for the dashboard; the password is asked for."""
    import secrets

    from webapp.config import read_config
    from webapp.password_entry import ask_for_password
    from webapp.storage.accounts import check_name, create_researcher, has_researcher
    from webapp.storage.database import open_database
    from webapp.storage.researchers import ROLES as KNOWN

    with refusals():
        check_name(name)
    with refusals(), open_database(read_config(os.environ)) as database:
        if if_missing and has_researcher(database, name):
            click.echo(f"The account {name!r} is there already; its password stays as it is.")
            return
        password = secrets.token_urlsafe(15) if generate_password else ask_for_password()
        create_researcher(database, name, password, datetime.now(UTC), KNOWN[ROLES.index(role)])
    click.echo(f"The account {name!r} is made; it is {_article(role)}.")
    if generate_password:
        click.echo(f"Its password, shown only now: {password}")


@admin.command("list")
def list_accounts() -> None:
    """List the accounts, their roles, and how many browsers are signed in to each."""
    from webapp.config import read_config
    from webapp.storage.accounts import accounts
    from webapp.storage.database import open_database

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        found = accounts(database, datetime.now(UTC))
    if not found:
        click.echo("There is no account yet; `xar admin create NAME` makes one.")
    for account in found:
        closed = "" if account.disabled_at is None else f", closed {account.disabled_at:%Y-%m-%d}"
        signed_in = f"signed in: {account.num_sessions}"
        click.echo(f"{account.name}: {account.role}, made {account.created_at:%Y-%m-%d}, {signed_in}{closed}")


@admin.command("role")
@click.argument("name")
@click.argument("role", type=click.Choice(ROLES))
def give_role(name: str, role: str) -> None:
    """Give the account NAME another ROLE."""
    from webapp.config import read_config
    from webapp.storage.accounts import change_role
    from webapp.storage.database import open_database
    from webapp.storage.records import COMMAND_LINE
    from webapp.storage.researchers import ROLES as KNOWN

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        change_role(database, name, KNOWN[ROLES.index(role)], COMMAND_LINE, datetime.now(UTC))
    click.echo(f"The account {name!r} is {_article(role)} now.")


@admin.command("password")
@click.argument("name")
@click.option("--generate-password", is_flag=True, help="Make a random password and print it, once.")
def change_password(name: str, *, generate_password: bool) -> None:
    """Give the account NAME another password; it is signed out everywhere."""
    import secrets

    from webapp.config import read_config
    from webapp.password_entry import ask_for_password
    from webapp.storage.accounts import change_password as change
    from webapp.storage.database import open_database
    from webapp.storage.records import COMMAND_LINE

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        password = secrets.token_urlsafe(15) if generate_password else ask_for_password()
        change(database, name, password, COMMAND_LINE, datetime.now(UTC))
    click.echo(f"The account {name!r} has another password, and is signed out everywhere.")
    if generate_password:
        click.echo(f"Its password, shown only now: {password}")


@admin.command("disable")
@click.argument("name")
def disable_account(name: str) -> None:
    """Close the account NAME and end its sessions. What it did stays on record."""
    from webapp.config import read_config
    from webapp.storage.accounts import disable
    from webapp.storage.database import open_database
    from webapp.storage.records import COMMAND_LINE

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        disable(database, name, COMMAND_LINE, datetime.now(UTC))
    click.echo(f"The account {name!r} is closed, and signed out everywhere.")


@admin.command("sign-out")
@click.argument("name")
def sign_out(name: str) -> None:
    """Sign the account NAME out of every browser."""
    from webapp.config import read_config
    from webapp.storage.accounts import revoke_sessions
    from webapp.storage.database import open_database
    from webapp.storage.records import COMMAND_LINE

    with refusals(), open_database(read_config(os.environ), make=False) as database:
        ended = revoke_sessions(database, name, COMMAND_LINE, datetime.now(UTC))
    click.echo(f"The account {name!r} was signed out; sessions ended: {ended}.")


def _article(role: str) -> str:
    return f"{'a' if role == 'viewer' else 'an'} {role}"
