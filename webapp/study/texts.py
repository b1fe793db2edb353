"""Everything that a participant reads, by key, in one language.

A language file is TOML: tables of texts and of lists of texts. A key such as `welcome.title` names a text in a table.
A text may hold parameters in braces, such as `{number}`, filled in where it is shown. A text that depends on a number
is a table of forms, `<key>.one` and `<key>.other` in English; which forms a language needs, the CLDR says.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from webapp.study.plurals import plural_categories, plural_category
from webapp.study.problems import StudyError, located, read_toml
from webapp.study.suggestions import nearest

_PARAMETER = re.compile(r"\{([a-z_]+)\}")


class MissingTextError(LookupError):
    """A text, or a parameter of it, that is not there."""


@dataclass(frozen=True, slots=True)
class ItemTexts:
    """The wording of an item of the questionnaire.

    Attributes:
        legend: The question.
        low: What the lowest point of the scale means.
        high: What the highest point of the scale means.
    """

    legend: str
    low: str
    high: str


class Texts:
    """The texts of one language.

    Attributes:
        language: The language's code, such as `en`.
        entries: The texts, and the lists of texts, by full key.
    """

    def __init__(self, language: str, entries: Mapping[str, str | tuple[str, ...]]) -> None:
        self.language = language
        self.entries = dict(entries)

    def __call__(self, key: str, /, **parameters: object) -> str:
        """Return a text with its parameters filled in.

        Raises:
            MissingTextError: There is no such text, or it names a parameter that is not given.
        """
        text = self.entries.get(key)
        if not isinstance(text, str):
            raise MissingTextError(f"there is no text {key!r} in language {self.language!r}")
        return fill(text, parameters, key)

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def list(self, key: str) -> tuple[str, ...]:
        """Return a list of texts.

        Raises:
            MissingTextError: There is no such list.
        """
        texts = self.entries.get(key)
        if not isinstance(texts, tuple):
            raise MissingTextError(f"there is no list of texts {key!r} in language {self.language!r}")
        return texts

    def plural(self, key: str, number: int, /, **parameters: object) -> str:
        """Return the form of a text that goes with a number, which fills in the parameter `number`.

        Raises:
            MissingTextError: There is no such form, or it names a parameter that is not given.
        """
        return self(f"{key}.{plural_category(self.language, number)}", number=number, **parameters)

    def item(self, item_id: str, experiment_id: str) -> ItemTexts:
        """Return the wording of an item in an experiment.

        Raises:
            MissingTextError: The item has no wording for this experiment and none for all.
        """
        own = f"items.{item_id}.{experiment_id}"
        legend = self(own if own in self else f"items.{item_id}")
        return ItemTexts(legend, low=self(f"scales.{item_id}.low"), high=self(f"scales.{item_id}.high"))


def fill(text: str, parameters: Mapping[str, object], key: str) -> str:
    """Fill in a text's parameters; braces around anything but a parameter's name stay as they are.

    Raises:
        MissingTextError: The text names a parameter that is not given.
    """

    def value(match: re.Match[str]) -> str:
        if match[1] not in parameters:
            raise MissingTextError(f"the text {key!r} needs the parameter {match[1]!r}")
        return str(parameters[match[1]])

    # Most texts have none, and a page has many.
    return _PARAMETER.sub(value, text) if "{" in text else text


def parse_texts(text: str, language: str, source: str) -> Texts:
    """Read a language file. Which texts a study needs is checked by `check_texts`.

    Args:
        text: The file's text.
        language: The language's code.
        source: What to call the file in messages.

    Raises:
        StudyError: The file is not TOML, or holds something that is neither text nor a list of texts.
    """
    tree = read_toml(text, source)
    entries: dict[str, str | tuple[str, ...]] = {}
    problems = []
    for path, value in _leaves(tree):
        if isinstance(value, str) and value.strip():
            entries[".".join(path)] = value
        elif isinstance(value, list) and value and all(isinstance(part, str) and part.strip() for part in value):
            entries[".".join(path)] = tuple(value)
        else:
            problems.append(located(text, source, path, f"is {value!r}; write a text or a list of texts, none empty"))
    if problems:
        raise StudyError(problems)
    return Texts(language, entries)


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a page expects of a text.

    Attributes:
        parameters: The parameters that are filled in; the text may leave some out.
        is_list: Whether it is a list of texts.
        is_plural: Whether it is a table of forms, one for each plural category of the language.
    """

    parameters: frozenset[str] = frozenset()
    is_list: bool = False
    is_plural: bool = False


def check_texts(
    texts: Texts, required: Mapping[str, Wanted], source: str, written: str = "", unused: Collection[str] = ()
) -> tuple[str, ...]:
    """Compare a language's texts with those that are needed.

    Args:
        texts: The texts.
        required: What is needed, by full key.
        source: What to call the language file in messages.
        written: The file's text, to name lines; none are named if it is left out.
        unused: Keys that are there and that nothing asks for, one of which may be a mistyped one.

    Returns:
        One line for each text that is missing, is a list where a text is needed or the other way round, or names a
        parameter that is never filled in. A text that nothing uses does no harm.
    """
    problems = []
    for key, wanted in _single(required, texts.language):
        entry = texts.entries.get(key)
        told = partial(located, written, source, key.split("."))
        if entry is None:
            near = nearest(key, unused)
            if near is None:
                problems.append(told("is missing"))
            else:
                wish = f"nothing uses it; did you mean {key!r}, which is missing?"
                problems.append(located(written, source, near.split("."), wish))
        elif isinstance(entry, tuple) != wanted.is_list:
            shape = "a list of texts" if wanted.is_list else "one text"
            shown = list(entry) if isinstance(entry, tuple) else entry
            problems.append(told(f"is {shown!r}; write {shape}"))
        else:
            whole = " ".join(entry) if isinstance(entry, tuple) else entry
            for name in sorted(set(_PARAMETER.findall(whole)) - wanted.parameters):
                known = ", ".join(f"{{{parameter}}}" for parameter in sorted(wanted.parameters)) or "none"
                problems.append(told(f"names the parameter {{{name}}}; it may use {known}"))
    return tuple(problems)


def _single(required: Mapping[str, Wanted], language: str) -> Iterator[tuple[str, Wanted]]:
    """Yield what is needed with a key for each plural form."""
    for key, wanted in required.items():
        if wanted.is_plural:
            form = Wanted(wanted.parameters | {"number"})
            yield from ((f"{key}.{category}", form) for category in plural_categories(language))
        else:
            yield key, wanted


def _leaves(tree: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], object]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*path, key))
        else:
            yield (*path, key), value
