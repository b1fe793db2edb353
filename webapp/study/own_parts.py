"""What a study brings along itself: kinds of explanation and worlds, named here and loaded by the build alone.

A web worker reads the declarations and never imports what they name; what came of it stands in the bundle.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, Field, JsonValue

from webapp.study.declared import Declared, Filled, Name, Seed, declared_list
from webapp.study.experiments import BUILT_IN_KINDS, KindName
from webapp.study.suggestions import meant

GYMNASIUM = "gymnasium:"
"""What stands before the name of a registered environment."""

_Problem = tuple[Sequence[str | int], str]

_MODULE_AND_NAME = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*:[^\W\d]\w*(?:\.[^\W\d]\w*)*")
_ENTRY_POINT = re.compile(r"\w[\w.-]*")


def _kind(value: str) -> str:
    if not _MODULE_AND_NAME.fullmatch(value) and not _ENTRY_POINT.fullmatch(value):
        raise ValueError('use "module:name", or the name of an entry point')
    return value


def _world(value: str) -> str:
    if value.startswith(GYMNASIUM):
        if not value.removeprefix(GYMNASIUM).strip():
            raise ValueError(f'name an environment, such as "{GYMNASIUM}FrozenLake-v1"')
        return value
    if not _MODULE_AND_NAME.fullmatch(value) and not _ENTRY_POINT.fullmatch(value):
        raise ValueError(f'use "module:name", "{GYMNASIUM}<id>" or the name of an entry point')
    return value


class OwnKind(Declared):
    """A kind of explanation of the study's own: it chooses which steps of the agent's way are shown.

    Attributes:
        use: A function, `module:name`, or the name of an entry point of the group `xar.kinds`.
    """

    use: Annotated[str, AfterValidator(_kind)]


class OwnWorld(Declared):
    """A world of the study's own, in place of a file in `layouts/`.

    Attributes:
        use: What gives it: `module:name`, `gymnasium:<id>`, or the name of an entry point of the group `xar.worlds`.
        options: What it is made with, by name.
        seed: Of the environment's `reset`: it decides the start, and the map where that is drawn.
        actions: Those to keep, in the order in which they are offered and ties are broken; all if left out.
    """

    use: Annotated[str, AfterValidator(_world)]
    options: dict[str, JsonValue] = Field(default_factory=dict)
    seed: Seed = 0
    actions: Annotated[tuple[Filled, ...], *declared_list(0)] = ()


OwnKinds = dict[KindName, OwnKind]
OwnWorlds = dict[Name, OwnWorld]


def own_part_problems(tree: Mapping[str, Any]) -> Iterator[_Problem]:
    """Yield what is wrong with a study's own kinds and worlds, as far as its file tells; see `contradictions`."""
    own_kinds, own_worlds = _table(tree.get("kinds")), _table(tree.get("worlds"))
    for kind in own_kinds:
        if kind in BUILT_IN_KINDS:
            yield ("kinds", kind), "is the name of a built-in kind; use another"
    layouts = tree.get("layouts")
    for world in own_worlds:
        if isinstance(layouts, list) and world not in layouts:
            yield ("worlds", world), "is none of the study's layouts; list it there, or remove it"
    if "ask" in tree and own_worlds:
        yield ("ask",), f"needs key-door layouts, and {next(iter(own_worlds))!r} is one of [worlds]; leave [ask] out"
    seeds = _table(_table(tree.get("learning")).get("seeds"))
    for layout in seeds:
        if layout in own_worlds:
            yield ("learning", "seeds", layout), "is one of [worlds], whose agent is not trained; remove it"
    declared = tree.get("experiments")
    for number, experiment in enumerate(declared if isinstance(declared, list) else ()):
        for path, message in _within(_table(experiment), own_kinds, own_worlds):
            yield ("experiments", number, *path), message


def _within(
    experiment: Mapping[str, Any], own_kinds: Mapping[str, Any], own_worlds: Mapping[str, Any]
) -> Iterator[_Problem]:
    known = ", ".join(f"{kind!r}" for kind in (*BUILT_IN_KINDS, *own_kinds))
    kinds, layouts = experiment.get("kinds"), experiment.get("layouts")
    for number, kind in enumerate(kinds if isinstance(kinds, list) else ()):
        if isinstance(kind, str) and kind not in BUILT_IN_KINDS and kind not in own_kinds:
            hint = meant(kind, (*BUILT_IN_KINDS, *own_kinds))
            yield ("kinds", number), f"is {kind!r}; {hint}use {known}, or declare [kinds.{kind}]"
    for number, layout in enumerate(layouts if isinstance(layouts, list) else ()):
        if isinstance(layout, str) and layout in own_worlds and experiment.get("situation") == "video":
            message = f"is {layout!r}, one of [worlds], and the questioner of a 'video' believes in doors"
            yield ("layouts", number), f"{message}; use a key-door layout, or the situation 'current_view'"


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}
