"""Messages about a study file: where, what stands there, and what is wanted."""

import difflib
import re
import tomllib
import typing
import unicodedata
from collections.abc import Iterable, Sequence
from datetime import date, time

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from webapp.study.suggestions import meant

Path = Sequence[str | int]
"""The keys and positions (from 0) that lead to a value of a TOML file."""


_MAX_SHOWN = 60
"""How many characters of a wrong value a message repeats."""


MAX_BYTES = 256 * 1024
"""The most that a study file, a file of texts or a layout may have."""

_MANY_PARTS = re.compile(r"(?m)^\s*\[*(?:[^.=\n\"'#]*\.){40}")

_UNSEEN = frozenset({"Cc", "Cf", "Co", "Cs", "Zl", "Zp"})
"""The categories of Unicode's control characters, marks of direction and ends of lines."""

_KEY = r"""(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)"""
"""One part of a TOML key."""


class StudyError(ValueError):
    """A study that cannot be used.

    Attributes:
        problems: One line for each problem, none left out.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(_visible(problem) for problem in problems)
        super().__init__("\n".join(self.problems))


def _visible(problem: str) -> str:
    """Return a line without what would end it, move a terminal's cursor or turn its text round, as keys may hold it."""
    return "".join(_escaped(letter) if unicodedata.category(letter) in _UNSEEN else letter for letter in problem)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")


def located(text: str, source: str, path: Path, message: str) -> str:
    """Put a message together with its place, such as `study.toml, line 7: experiments[1].kinds: ...`.

    Positions in lists are counted from 1, as people do.
    """
    line = find_line(text, path)
    where = source if line is None else f"{source}, line {line}"
    return f"{where}: {_written(path)}: {message}" if path else f"{where}: {message}"


def describe_problem(model: type[BaseModel], problem: ErrorDetails, text: str, source: str) -> str:
    """Turn one of pydantic's problems into a line that names place, value and wish."""
    path = _within_file(model, problem["loc"])
    value = problem["input"]
    match problem["type"]:
        case "extra_forbidden":
            message = f"is not a setting here{_suggestion(model, path)}"
        case "missing":
            message = "is missing"
        case "value_error":
            message = f"is {_short(value)}; {problem['ctx']['error']}"
        case "literal_error":
            expected = str(problem["ctx"]["expected"])
            choices = re.findall(r"'([^']*)'", expected)
            message = f"is {_short(value)}; {meant(value, choices)}use {expected}"
        case "too_short":
            message = "is empty; list at least one"
        case _:
            message = f"is {_short(value)}; {_wish(problem)}"
    return located(text, source, path, message)


def find_line(text: str, path: Path) -> int | None:
    """Return the line, from 1, on which a value of a TOML text is set; the nearest enclosing one if it has none.

    It understands tables, arrays of tables and keys at the beginning of a line, which is how study files are
    written; a path it cannot follow gives None.
    """
    places = _places(text)
    wanted = tuple(path)
    while wanted:
        if wanted in places:
            return places[wanted]
        wanted = wanted[:-1]
    return None


def _places(text: str) -> dict[tuple[str | int, ...], int]:
    places: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    counts: dict[tuple[str | int, ...], int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if heading := re.match(r"\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$", line):
            table = _resolve(_keys(heading[2]), counts)
            if heading[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                places.setdefault(table, number)
                table = (*table, counts[table])
            places.setdefault(table, number)
        elif setting := re.match(rf"\s*({_KEY}(?:\s*\.\s*{_KEY})*)\s*=", line):
            places.setdefault((*table, *_keys(setting[1])), number)
    return places


def _keys(dotted: str) -> tuple[str, ...]:
    parts = re.findall(r"""\"([^"]*)"|'([^']*)'|([^\s."']+)""", dotted)
    return tuple(quoted or single or bare for quoted, single, bare in parts)


def _resolve(keys: Sequence[str], counts: dict[tuple[str | int, ...], int]) -> tuple[str | int, ...]:
    """Insert the position of the array element that a table heading belongs to."""
    resolved: tuple[str | int, ...] = ()
    for key in keys[:-1]:
        resolved = (*resolved, key)
        if resolved in counts:
            resolved = (*resolved, counts[resolved])
    return (*resolved, keys[-1])


def _written(path: Path) -> str:
    parts = (f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in path)
    return "".join(parts).removeprefix(".")


def _within_file(model: type[BaseModel], loc: Path) -> tuple[str | int, ...]:
    """Drop what pydantic adds to a path, such as the name of a union's branch or `[key]`."""
    kept: list[str | int] = []
    annotation: object = model
    for part in loc:
        inner = _inner(annotation, part)
        if inner is None:
            continue
        kept.append(part)
        annotation = inner
    return tuple(kept)


def _inner(annotation: object, part: str | int) -> object | None:
    """Return what a key or position leads to, or None if it leads nowhere in a file."""
    model = _model(annotation)
    if model is not None:
        if not isinstance(part, str):
            return None
        field = model.model_fields.get(part)
        return object if field is None else field.annotation
    arguments: tuple[object, ...] = typing.get_args(annotation)
    if typing.get_origin(annotation) is tuple and isinstance(part, int):
        return arguments[0]
    if typing.get_origin(annotation) is dict and part != "[key]":
        return arguments[1]
    return None


def _model(annotation: object) -> type[BaseModel] | None:
    if typing.get_origin(annotation) is dict:
        return None
    candidates = (annotation,) if typing.get_origin(annotation) is tuple else (annotation, *typing.get_args(annotation))
    for candidate in candidates:
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return None


def _suggestion(model: type[BaseModel], path: Path) -> str:
    if len(path) > 1 and path[-1] in model.model_fields:
        return f"; write {path[-1]!r} at the top of the file, before the first [section]"
    annotation: object = model
    for part in path[:-1]:
        annotation = _inner(annotation, part)
    owner = _model(annotation)
    known = list(owner.model_fields) if owner else []
    near = difflib.get_close_matches(str(path[-1]), known, n=1)
    if not known:
        return "; there are none, so leave the section empty"
    return f"; did you mean {near[0]!r}?" if near else f"; the settings are {', '.join(known)}"


_WISHES = {
    "bool_type": "use true or false, without quotes",
    "dict_type": "use a table",
    "finite_number": "use a number",
    "float_type": "use a number, without quotes",
    "greater_than": "use more than {gt:g}",
    "greater_than_equal": "use {ge:g} or more",
    "int_from_float": "use a whole number, without a point",
    "int_type": "use a whole number, without quotes or a point",
    "less_than": "use less than {lt:g}",
    "less_than_equal": "use {le:g} or less",
    "model_type": "use a table",
    "string_pattern_mismatch": "write something",
    "string_too_short": "write something",
    "string_type": "use text in quotes",
    "tuple_type": "use a list in square brackets",
}
"""What is wanted, in words for who writes TOML, by the type of pydantic's problem."""

_TOML_WISHES = {
    "Cannot overwrite a value": "it is there twice; keep one",
    "Cannot declare": "it is there twice; keep one",
    "Expected '=' after a key": "write a setting as key = value",
    "Invalid value": "use text in quotes, a number, true, false, or a list in square brackets",
    "Illegal character": "close the quotes",
    "Unclosed array": "close the square brackets",
}
"""The same for files that are no TOML, by the beginning of what the reader of TOML says."""


def _wish(problem: ErrorDetails) -> str:
    wish = _WISHES.get(problem["type"])
    if wish is not None:
        return wish.format(**problem.get("ctx", {}))
    message = problem["msg"].removeprefix("Input ")
    return "it " + message if message.startswith("should") else message[0].lower() + message[1:]


def read_toml(text: str, source: str) -> dict[str, typing.Any]:
    """Parse a file of a study, which somebody else may have written to harm whoever reads it.

    Args:
        text: The file's text.
        source: What to call the file in messages.

    Raises:
        StudyError: It is no TOML, too large, or nested so deeply that no study is meant.
    """
    check_size(len(text.encode(errors="replace")), source)
    if _MANY_PARTS.search(text):
        raise StudyError([f"{source}: has a key of more than 40 parts; a study file has none"])
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise StudyError([not_toml(error, source)]) from None
    except RecursionError:
        raise StudyError([f"{source}: lists stand within lists too deeply to be read; take some out"]) from None
    except ValueError:  # Python reads no number of more than 4,300 digits.
        raise StudyError([f"{source}: has a number of thousands of digits; use a shorter one"]) from None


def check_size(num_bytes: int, source: str) -> None:
    """Refuse a file of a study that is larger than any that is meant.

    Raises:
        StudyError: It is.
    """
    if num_bytes > MAX_BYTES:
        raise StudyError([f"{source}: has {num_bytes} bytes; a file of a study has at most {MAX_BYTES}"])


def not_toml(error: tomllib.TOMLDecodeError, source: str) -> str:
    """Say where a file stops being TOML, and what is wanted there."""
    found = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|(end of document))\)", str(error), re.DOTALL)
    if found is None:
        return f"{source}: not a TOML file: {error}"
    where = f"{source}, line {found[2]}, column {found[3]}" if found[2] else f"{source}, at its end"
    wish = next((wish for begin, wish in _TOML_WISHES.items() if found[1].startswith(begin)), None)
    return f"{where}: not a TOML file: {found[1]}" + ("" if wish is None else f"; {wish}")


def _short(value: object) -> str:
    written = str(value).lower() if isinstance(value, bool) else repr(value)
    if isinstance(value, date | time):
        written = value.isoformat()
    return written if len(written) <= _MAX_SHOWN else written[: _MAX_SHOWN - 3] + "..."
