"""The files that a study was built from, kept within its bundle, so that it can be rebuilt from nothing else.

They stand under `sources/`: `study/` holds the study's own folder, `shared_texts/` the texts that all studies share.
The study's own code may read anything in its folder, so every file of it is kept.
"""

import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

from webapp.study.problems import StudyError
from webapp.study.protocol import Study

SOURCES = "sources"
STUDY = "study"
SHARED = "shared_texts"

MAX_FILE_BYTES = 5_000_000
MAX_FOLDER_BYTES = 50_000_000
"""The most that one file of a study's folder, and all of them, may have: every version of the study keeps them."""


def frozen_files(folder: Path, study: Study, shared_texts: Path) -> Mapping[str, bytes]:
    """Read every file that a study is built from, and its analysis plan.

    Args:
        folder: The study's folder.
        study: The study as declared in it.
        shared_texts: The folder of the texts that all studies share.

    Returns:
        The bytes by the path within `sources/`.

    Raises:
        StudyError: The analysis plan is missing or no text, or the folder holds what cannot be kept.
    """
    check_plan(folder, study)
    problems = list(folder_problems(folder))
    if problems:
        raise StudyError(problems)
    own = {f"{STUDY}/{file.relative_to(folder).as_posix()}": _read(file) for file, _ in _entries(folder)}
    shared = {f"{SHARED}/{language}.toml": shared_texts / f"{language}.toml" for language in study.languages}
    return {**own, **{name: file.read_bytes() for name, file in shared.items() if file.exists()}}


def folder_problems(folder: Path) -> Iterator[str]:
    """Say what in a study's folder cannot be kept with the study.

    A link would be kept as what it leads to at the time, which is another file than the study's.

    Raises:
        StudyError: A folder cannot be read.
    """
    total = 0
    for file, found in _entries(folder):
        total += found.st_size
        if stat.S_ISLNK(found.st_mode):
            yield f"{file}: is a symbolic link; put the file itself into the study's folder"
        elif not stat.S_ISREG(found.st_mode):
            yield f"{file}: is no regular file; move it out of the study's folder"
        elif found.st_size > MAX_FILE_BYTES:
            yield f"{file}: has {_megabytes(found.st_size)}; a file of a study has at most {_megabytes(MAX_FILE_BYTES)}"
        if not file.name.isprintable():
            yield f"{str(file)!r}: has characters in its name that cannot be kept; rename it"
    if total > MAX_FOLDER_BYTES:
        wish = f"all of it is kept with the study, so use at most {_megabytes(MAX_FOLDER_BYTES)}"
        yield f"{folder}: has {_megabytes(total)} of files; {wish}"


def check_apart(folder: Path, instance: Path) -> None:
    """Refuse an instance within a study's folder: its secrets and answers would be kept with the study.

    Raises:
        StudyError: It lies there.
    """
    if instance.resolve().is_relative_to(folder.resolve()):
        wish = "all of which is kept with the study; move it out, or name another with XAR_INSTANCE"
        raise StudyError([f"{instance}: the instance lies in the study's folder, {wish}"])


def check_plan(folder: Path, study: Study) -> None:
    """Refuse an analysis plan that cannot be read.

    Raises:
        StudyError: It is missing or no text.
    """
    if study.analysis is None or study.analysis.plan is None:
        return
    file = folder / study.analysis.plan
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise StudyError([f"{file}: is missing; analysis.plan names it"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError([f"{file}: cannot be read as UTF-8 text: {error}"]) from None
    if not text.strip():
        raise StudyError([f"{file}: is empty; write down the planned analysis, or leave analysis.plan out"])


def _entries(folder: Path) -> Iterator[tuple[Path, os.stat_result]]:
    """Yield everything in a folder that is kept and is no folder itself, links among it, in the order of the paths.

    Hidden files and folders belong to editors and version control, and Python writes `__pycache__` by itself.

    Raises:
        StudyError: A folder cannot be read.
    """
    try:
        paths = sorted(folder.iterdir())
    except OSError as error:
        raise StudyError([f"{folder}: cannot be read: {error.strerror}"]) from None
    for path in paths:
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        found = path.lstat()
        if stat.S_ISDIR(found.st_mode):
            yield from _entries(path)
        else:
            yield path, found


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise StudyError([f"{file}: cannot be read: {error.strerror}"]) from None


def _megabytes(size: int) -> str:
    return f"{size / 1_000_000:.3g} MB"
