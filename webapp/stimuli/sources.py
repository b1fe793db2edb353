"""A study's folder, read and checked as a whole: the study file, its layouts, its texts, its own kinds and worlds."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.sentences import load_phrases
from webapp.explainer.pictures.words import PHRASES, check_phrases
from webapp.explainer.worlds.finite import own_failures
from webapp.explainer.worlds.key_door import ACTIONS, tabulate
from webapp.explainer.worlds.layout import Layout, LayoutError, parse_layout
from webapp.stimuli.frozen_files import folder_problems
from webapp.stimuli.own_kinds import OwnKindFunction
from webapp.stimuli.own_worlds import ShownWorld, load_world
from webapp.stimuli.plug_ins import KINDS_GROUP, Origin, find, origin_of, study_modules
from webapp.study.page_texts import PAGE_TEXTS
from webapp.study.problems import StudyError, check_size, located
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
        layouts: Every key-door layout of the study, by name, in the study's order; the goal of each can be reached.
        texts: Every language of the study, by code, in the study's order; nothing is missing from any.
        step_phrases: By language, the phrases that put the agent's steps into words (`pictures.sentences`); none
            where no layout needs them.
        worlds: The study's own worlds, by the name of the layout whose place they take, in the study's order.
        kinds: The functions of the study's own kinds, by name.
        origins: Where own kinds and worlds came from, by their place in the study file, such as `kinds.turns`.
    """

    study: Study
    layouts: Mapping[str, Layout]
    texts: Mapping[str, Texts]
    step_phrases: Mapping[str, Mapping[str, str]]
    worlds: Mapping[str, ShownWorld] = field(default_factory=dict)
    kinds: Mapping[str, OwnKindFunction] = field(default_factory=dict)
    origins: Mapping[str, Origin] = field(default_factory=dict)

    def exact_table(self, layout: str) -> DeterministicMDP:
        """Return where each action leads in a layout, whatever an agent knows of it."""
        return self.worlds[layout].table if layout in self.worlds else tabulate(self.layouts[layout])


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
    problems += folder_problems(folder)
    key_door = [name for name in study.layouts if name not in study.worlds]
    step_phrases: dict[str, Mapping[str, str]] = {}
    for number, language in enumerate(study.languages if key_door else ()):
        try:
            step_phrases[language] = load_phrases(language)
        except ValueError as error:
            problems.append(located(declared, str(file), ("languages", number), str(error)))
    tell = partial(located, declared, str(file))
    layouts = _read_all(key_door, partial(_read_layout, folder / "layouts"), problems)
    with study_modules(folder):
        kinds = _load_kinds(study, folder, tell, problems)
        worlds = _load_worlds(study, folder, tell, problems)
    read_texts = partial(_read_texts, (shared_texts, folder / "texts"), study, worlds.values())
    texts = _read_all(study.languages, read_texts, problems)
    if problems:
        raise StudyError(problems)
    origins = {f"kinds.{name}": origin for name, (_, origin) in kinds.items()}
    origins |= {f"worlds.{name}": world.origin for name, world in worlds.items()}
    functions = {name: function for name, (function, _) in kinds.items()}
    return Sources(study, layouts, texts, step_phrases, worlds, functions, origins)


_Tell = Callable[[Sequence[str | int], str], str]
"""Puts a message together with its place in the study file."""


def _load_kinds(
    study: Study, folder: Path, tell: _Tell, problems: list[str]
) -> dict[str, tuple[OwnKindFunction, Origin]]:
    loaded = {}
    for name, kind in study.kinds.items():
        try:
            function = find(kind.use, KINDS_GROUP, folder)
        except ValueError as problem:
            problems.append(tell(("kinds", name, "use"), str(problem)))
            continue
        if callable(function):
            loaded[name] = (function, origin_of(kind.use, function, folder))
        else:
            problems.append(tell(("kinds", name, "use"), f"{kind.use!r} is {function!r}; it should be a function"))
    return loaded


def _load_worlds(study: Study, folder: Path, tell: _Tell, problems: list[str]) -> dict[str, ShownWorld]:
    loaded = {}
    for name in (layout for layout in study.layouts if layout in study.worlds):
        if (folder / "layouts" / f"{name}.txt").exists():
            problems.append(tell(("worlds", name), f"there is a layouts/{name}.txt too; keep one of them"))
        try:
            with own_failures(study.worlds[name].use, "while it was loaded"):
                loaded[name] = load_world(name, study.worlds[name], study.languages, folder)
        except ValueError as problem:
            problems.append(tell(("worlds", name, "use"), str(problem)))
    return loaded


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


def _read_texts(folders: tuple[Path, Path], study: Study, worlds: Collection[ShownWorld], language: str) -> Texts:
    """Read a study's own texts, in the second folder, over the shared ones.

    A problem is told of the file in which the text stands. What is missing is missing from the study's own. What the
    actions of the study's own worlds are called only the study itself can say: a shared text means another action.
    """
    shared_file, file = (folder / f"{language}.toml" for folder in folders)
    own = parse_texts(_read(file), language, str(file))
    shared = (
        parse_texts(_read(shared_file), language, str(shared_file)) if shared_file.exists() else Texts(language, {})
    )
    texts = Texts(language, {**shared.entries, **own.entries})
    of_study, of_all = dict[str, Wanted](), dict[str, Wanted]()
    wanted_texts = _wanted(study, texts)
    for key, wanted in wanted_texts.items():
        (of_study if _has(own, key) or not _has(shared, key) else of_all)[key] = wanted
    of_worlds = {f"actions.{action}": Wanted() for world in worlds for action in world.table.actions}
    asked = {**wanted_texts, **of_worlds}
    unused = [key for key in own.entries if not any(key == one or key.startswith(f"{one}.") for one in asked)]
    problems = [
        *check_texts(texts, of_study, str(file), _read(file), unused),
        *check_texts(texts, of_all, str(shared_file), _read(shared_file) if of_all else ""),
    ]
    names = check_texts(own, of_worlds, str(file), _read(file), unused)
    problems += [problem for problem in names if problem not in problems]
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
        check_size(file.stat().st_size, str(file))
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise StudyError([f"{file}: is missing"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError([f"{file}: cannot be read as UTF-8 text: {error}"]) from None
