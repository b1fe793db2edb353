"""A study folder to begin with: a copy of one that is shipped, under a name of its own.

The documented example is the shipped study itself, comments and all; nothing here says a second time what can be set.
"""

import re
import shutil
from pathlib import Path

from webapp.stimuli.sources import STUDIES
from webapp.study.problems import StudyError

TEMPLATES = ("sakai2021", "understanding")
"""The paper's experiments, and a study in which almost everything is switched on."""


def write_study(name: str, template: str, parent: Path) -> Path:
    """Write a study folder; nothing is overwritten.

    Args:
        name: Of the study and of its folder.
        template: The shipped study to copy.
        parent: The folder to write it into, made if it is missing.

    Returns:
        The new folder.

    Raises:
        StudyError: The name cannot be used or is taken, or the folder cannot be written.
    """
    _check_name(name)
    folder = parent / name
    if parent.exists() and not parent.is_dir():
        raise StudyError([f"{parent} is a file; name a folder with --into"])
    try:
        parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(STUDIES / template, folder, ignore=shutil.ignore_patterns("__pycache__"))
        file = folder / "study.toml"
        declared, count = re.subn(
            r'^name = ".*"$', f'name = "{name}"', file.read_text(encoding="utf-8"), count=1, flags=re.MULTILINE
        )
        if count != 1:
            raise StudyError([f"{file}: has no line that gives it a name; write one"])
        file.write_text(_heading(template) + declared, encoding="utf-8")
    except FileExistsError:
        raise StudyError([f"{folder} is there already; choose another name, or another folder with --into"]) from None
    except OSError as error:
        raise StudyError([f"{folder} cannot be written: {error.strerror}"]) from None
    return folder


def _check_name(name: str) -> None:
    if not re.fullmatch(r"[a-z0-9](?:[a-z0-9_-]{0,62}[a-z0-9])?", name):
        wish = "use up to 64 lower-case letters, digits, - and _, with a letter or digit at either end"
        raise StudyError([f"a study cannot be called {name!r}; {wish}"])
    if (STUDIES / name).exists():
        raise StudyError([f"a study cannot be called {name!r}, which comes with the program; choose another name"])


def _heading(template: str) -> str:
    origin = f"# Copied from the study {template} by `xar study new`."
    return f"{origin} What its comments say of the paper holds for that one.\n#\n"
