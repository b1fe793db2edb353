"""Where a new account's password comes from: a terminal, or standard input where there is none."""

import sys

import click

from webapp.command_line import CommandError


def ask_for_password() -> str:
    """Let the password be typed twice at a terminal, unseen; where there is none, read it from standard input.

    Raises:
        CommandError: Standard input is closed, empty, or has lines that differ.
    """
    if sys.stdin is not None and sys.stdin.isatty():
        return str(click.prompt("Password", hide_input=True, confirmation_prompt=True))
    lines = [] if sys.stdin is None else sys.stdin.read().splitlines()
    if not any(lines):
        raise CommandError("there is no terminal to type a password at; use --generate-password")
    if len(set(lines)) > 1:
        raise CommandError("the lines of standard input differ; give one password, once or twice")
    return lines[0]
