"""The files that a study was built from, kept within its bundle, so that it can be rebuilt from nothing else.

They stand under `sources/`: `study/` holds the study's own folder, `shared_texts/` the texts that all studies share.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from webapp.study.problems import StudyError
from webapp.study.protocol import Study

SOURCES = "sources"
STUDY = "study"
SHARED = "shared_texts"


def frozen_files(folder: Path, study: Study, shared_texts: Path) -> Mapping[str, bytes]:
    """Read every file that a study is built from, and its analysis plan.

    Args:
        folder: The study's folder.
        study: The study as declared in it.
        shared_texts: The folder of the texts that all studies share.

    Returns:
        The bytes by the path within `sources/`.

    Raises:
        StudyError: The analysis plan is missing or no text.
    """
    own = {f"{STUDY}/{file.relative_to(folder).as_posix()}": file.read_bytes() for file in _own(folder, study)}
    shared = {f"{SHARED}/{language}.toml": shared_texts / f"{language}.toml" for language in study.languages}
    return {**own, **{name: file.read_bytes() for name, file in shared.items() if file.exists()}}


def own_modules(folder: Path) -> list[Path]:
    """Return the study's own code: the Python files beside its study file."""
    return sorted(folder.glob("*.py"))


def check_plan(folder: Path, study: Study) -> None:
    """Refuse an analysis plan that cannot be read.

    Raises:
        StudyError: It is missing or no text.
    """
    if study.analysis is None:
        return
    file = folder / study.analysis.plan
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise StudyError([f"{file}: is missing; analysis.plan names it"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError([f"{file}: cannot be read as UTF-8 text: {error}"]) from None
    if not text.strip():
        raise StudyError([f"{file}: is empty; write down the planned analysis, or leave [analysis] out"])


def _own(folder: Path, study: Study) -> Iterator[Path]:
    check_plan(folder, study)
    yield folder / "study.toml"
    yield from (folder / "layouts" / f"{name}.txt" for name in study.layouts if name not in study.worlds)
    yield from (folder / "texts" / f"{language}.toml" for language in study.languages)
    yield from own_modules(folder)
    if study.analysis is not None:
        yield folder / study.analysis.plan
