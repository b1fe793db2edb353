"""A study's folder, read and checked as a whole: the study file, its layouts, its texts."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from webapp.explainer.pictures.sentences import load_phrases
from webapp.explainer.pictures.words import PHRASES, check_phrases
from webapp.explainer.worlds.key_door import ACTIONS, tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError, parse_layout
from webapp.study.page_texts import PAGE_TEXTS
from webapp.study.problems import StudyError, located
from webapp.study.protocol import Study, parse_study
from webapp.study.study_texts import study_texts
from webapp.study.texts import Texts, Wanted, check_texts, parse_texts

STUDIES = Path(__file__).parents[1] / "studies"
"""The studies that come with the program, each in a folder of its own."""

SHARED_TEXTS = STUDIES / "texts"
"""The texts that all studies share, a file for each language."""

_Part = TypeVar("_Part", Layout, Texts)


@dataclass(frozen=True, slots=True)
class Sources:
    """What a bundle is built from.

    Attributes:
        study: The study as declared.
        layouts: Every layout of the study, by name, in the study's order; the goal of each can be reached.
        texts: Every language of the study, by code, in the study's order; nothing is missing from any.
        step_phrases: By language, the phrases that put the agent's steps into words (`pictures.sentences`).
    """

    study: Study
    layouts: Mapping[str, Layout]
    texts: Mapping[str, Texts]
    step_phrases: Mapping[str, Mapping[str, str]]


def find_study(name: str) -> Path:
    """Return the folder of a declared study: one of this program's by name, or any by its path.

    Raises:
        StudyError: There is none.
    """
    for folder in (STUDIES / name, Path(name)):
        if (folder / "study.toml").is_file():
            return folder.resolve()
    known = sorted(file.parent.name for file in STUDIES.glob("*/study.toml"))
    wish = f"use {' or '.join(known)}, or a folder that holds a study.toml"
    raise StudyError([f"there is no study {name!r}; {wish}"])


def read_sources(folder: Path, shared_texts: Path = SHARED_TEXTS) -> Sources:
    """Read a study's folder: `study.toml`, `layouts/<name>.txt` and `texts/<language>.toml`.

    Args:
        folder: The study's folder.
        shared_texts: The texts that all studies share. A study's own add to them, and take their place where both have
            one; a language without a file there is all the study's.

    Raises:
        StudyError: Something is missing or wrong. The message has a line for each problem, of all files together;
            only a study file that cannot be used is told alone, since it says which other files there are.
    """
    file = folder / "study.toml"
    declared = _read(file)
    study = parse_study(declared, str(file))
    problems: list[str] = []
    if study.name != folder.name:
        problems.append(f"{file}: name: is {study.name!r} in the folder {folder.name!r}; use one name")
    step_phrases: dict[str, Mapping[str, str]] = {}
    for number, language in enumerate(study.languages):
        try:
            step_phrases[language] = load_phrases(language)
        except ValueError as error:
            problems.append(located(declared, str(file), ("languages", number), str(error)))
    layouts = _read_all(study.layouts, partial(_read_layout, folder / "layouts"), problems)
    texts = _read_all(study.languages, partial(_read_texts, (shared_texts, folder / "texts"), study), problems)
    if problems:
        raise StudyError(problems)
    return Sources(study, layouts, texts, step_phrases)


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


def _read_texts(folders: tuple[Path, Path], study: Study, language: str) -> Texts:
    """Read a study's own texts, in the second folder, over the shared ones.

    A problem is told of the file in which the text stands. What is missing is missing from the study's own.
    """
    shared_file, file = (folder / f"{language}.toml" for folder in folders)
    own = parse_texts(_read(file), language, str(file))
    shared = (
        parse_texts(_read(shared_file), language, str(shared_file)) if shared_file.exists() else Texts(language, {})
    )
    texts = Texts(language, {**shared.entries, **own.entries})
    of_study, of_all = dict[str, Wanted](), dict[str, Wanted]()
    for key, wanted in _wanted(study, texts).items():
        (of_study if _has(own, key) or not _has(shared, key) else of_all)[key] = wanted
    problems = [*check_texts(texts, of_study, str(file)), *check_texts(texts, of_all, str(shared_file))]
    if problems:
        raise StudyError(problems)
    try:
        check_phrases(phrases(texts))
    except ValueError as error:
        raise StudyError([f"{file if _has(own, 'pictures') else shared_file}: pictures: {error}"]) from None
    return texts


def _has(texts: Texts, key: str) -> bool:
    """Tell whether there is a text of this key, or one below it, such as a plural form."""
    return any(known == key or known.startswith(f"{key}.") for known in texts.entries)


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
