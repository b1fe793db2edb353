"""Messages about a study file: where, what stands there, and what is wanted."""

import difflib
import re
import typing
from collections.abc import Iterable, Sequence

from pydantic import BaseModel
from pydantic_core import ErrorDetails

Path = Sequence[str | int]
"""The keys and positions (from 0) that lead to a value of a TOML file."""


_MAX_SHOWN = 60
"""How many characters of a wrong value a message repeats."""


_KEY = r"""(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)"""
"""One part of a TOML key."""


class StudyError(ValueError):
    """A study that cannot be used.

    Attributes:
        problems: One line for each problem, none left out.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


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
            message = f"is {value!r}; {problem['ctx']['error']}"
        case "literal_error":
            message = f"is {value!r}; use {problem['ctx']['expected']}"
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
    candidates = (annotation,) if typing.get_origin(annotation) is tuple else (annotation, *typing.get_args(annotation))
    for candidate in candidates:
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return None


def _suggestion(model: type[BaseModel], path: Path) -> str:
    annotation: object = model
    for part in path[:-1]:
        annotation = _inner(annotation, part)
    owner = _model(annotation)
    known = list(owner.model_fields) if owner else []
    near = difflib.get_close_matches(str(path[-1]), known, n=1)
    return f"; did you mean {near[0]!r}?" if near else f"; the settings are {', '.join(known)}"


def _wish(problem: ErrorDetails) -> str:
    message = problem["msg"].removeprefix("Input ")
    return "it " + message if message.startswith("should") else message[0].lower() + message[1:]


def _short(value: object) -> str:
    written = repr(value)
    return written if len(written) <= _MAX_SHOWN else written[: _MAX_SHOWN - 3] + "..."
