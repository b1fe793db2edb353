"""A study's folder, read and checked as a whole: the study file, its layouts, its texts."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from webapp.explainer.pictures.words import PHRASES, check_phrases
from webapp.explainer.worlds.key_door import ACTIONS, tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError, parse_layout
from webapp.study.page_texts import PAGE_TEXTS
from webapp.study.problems import StudyError
from webapp.study.protocol import Study, parse_study
from webapp.study.texts import Texts, Wanted, check_texts, parse_texts, study_texts

_Part = TypeVar("_Part", Layout, Texts)


@dataclass(frozen=True, slots=True)
class Sources:
    """What a bundle is built from.

    Attributes:
        study: The study as declared.
        layouts: Every layout of the study, by name, in the study's order; the goal of each can be reached.
        texts: Every language of the study, by code, in the study's order; nothing is missing from any.
    """

    study: Study
    layouts: Mapping[str, Layout]
    texts: Mapping[str, Texts]


def find_study(name: str) -> Path:
    """Return the folder of a declared study: one of this program's by name, or any by its path.

    Raises:
        StudyError: There is none.
    """
    declared = Path(__file__).parents[1] / "studies"
    for folder in (declared / name, Path(name)):
        if (folder / "study.toml").is_file():
            return folder.resolve()
    known = sorted(file.parent.name for file in declared.glob("*/study.toml"))
    wish = f"use {' or '.join(known)}, or a folder that holds a study.toml"
    raise StudyError([f"there is no study {name!r}; {wish}"])


def read_sources(folder: Path) -> Sources:
    """Read a study's folder: `study.toml`, `layouts/<name>.txt` and `texts/<language>.toml`.

    Raises:
        StudyError: Something is missing or wrong. The message has a line for each problem, of all files together;
            only a study file that cannot be used is told alone, since it says which other files there are.
    """
    study = parse_study(_read(folder / "study.toml"), str(folder / "study.toml"))
    problems: list[str] = []
    if study.name != folder.name:
        problems.append(f"{folder / 'study.toml'}: name: is {study.name!r} in the folder {folder.name!r}; use one name")
    layouts = _read_all(study.layouts, partial(_read_layout, folder / "layouts"), problems)
    texts = _read_all(study.languages, partial(_read_texts, folder / "texts", study), problems)
    if problems:
        raise StudyError(problems)
    return Sources(study, layouts, texts)


def phrases(texts: Texts) -> dict[str, str]:
    """Return the phrases that put pictures into words, by the names that `describe` knows."""
    return {key: str(texts.entries[f"pictures.{key}"]) for key in PHRASES}


def _read_all(names: Iterable[str], read: Callable[[str], _Part], problems: list[str]) -> dict[str, _Part]:
    """Read the files of some names, adding what is wrong with any to the problems."""
    parts: dict[str, _Part] = {}
    for name in names:
        try:
            parts[name] = read(name)
        except StudyError as error:
            problems += error.problems
        except LayoutError as error:
            problems.append(str(error))
    return parts


def _read_layout(folder: Path, name: str) -> Layout:
    file = folder / f"{name}.txt"
    layout = parse_layout(_read(file), str(file))
    tabulate(layout, str(file))
    return layout


def _read_texts(folder: Path, study: Study, language: str) -> Texts:
    file = folder / f"{language}.toml"
    texts = parse_texts(_read(file), language, str(file))
    problems = check_texts(texts, _wanted(study, texts), str(file))
    if problems:
        raise StudyError(problems)
    try:
        check_phrases(phrases(texts))
    except ValueError as error:
        raise StudyError([f"{file}: pictures: {error}"]) from None
    return texts


def _wanted(study: Study, texts: Texts) -> dict[str, Wanted]:
    return {
        **PAGE_TEXTS,
        **study_texts(study, texts),
        **{f"actions.{action}": Wanted() for action in ACTIONS},
        **{f"pictures.{key}": Wanted(parameters) for key, parameters in PHRASES.items()},
    }


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise StudyError([f"{file}: is missing"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError([f"{file}: cannot be read as UTF-8 text: {error}"]) from None
