"""Every state that can be reached, as a picture and in words, each once."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.render import digest, draw
from webapp.explainer.pictures.words import describe
from webapp.explainer.worlds.key_door import key_door_state
from webapp.explainer.worlds.layout import Layout
from webapp.explainer.worlds.view import View, egocentric_view
from webapp.stimuli.build_error import BuildError
from webapp.stimuli.own_worlds import ShownWorld
from webapp.stimuli.sources import Sources, phrases


@dataclass(frozen=True, slots=True)
class Album:
    """The pictures of a bundle, numbered in the order of their digests.

    Of a world of the study's own two states may look the same and be described differently. Then the picture has a
    number for each description.

    Attributes:
        files: The PNG bytes, by digest.
        digests: In the order of the numbers.
        alts: By language, the words for each picture, in the order of the numbers.
        numbers: By layout, the number of the picture of each state `[S]` of the layout's table.
    """

    files: Mapping[str, bytes]
    digests: tuple[str, ...]
    alts: Mapping[str, tuple[str, ...]]
    numbers: Mapping[str, tuple[int, ...]]


_Words = tuple[str, ...]
"""A picture in the words of each language, in the study's order."""


def draw_album(sources: Sources, worlds: Mapping[str, DeterministicMDP], progress: Callable[[float], None]) -> Album:
    """Draw every state of every layout.

    Args:
        sources: The study's layouts, worlds and texts.
        worlds: By layout, the table of the world that `numbers` refers to.
        progress: Is told how much is done, from 0 to 1.

    Raises:
        BuildError: A world of the study's own cannot be drawn or described.
    """
    views = {name: _views(layout, worlds[name]) for name, layout in sources.layouts.items()}
    distinct = list(dict.fromkeys(view for layout_views in views.values() for view in layout_views))
    num_parts = max(1, len(sources.worlds) + bool(distinct))
    pictures: dict[View, bytes] = {}
    for done, view in enumerate(distinct, start=1):
        pictures[view] = draw(view)
        progress(done / len(distinct) / num_parts)
    files = {digest(picture): picture for picture in pictures.values()}
    keys = {view: (digest(picture), _said(view, sources)) for view, picture in pictures.items()}
    shown = {name: [keys[view] for view in layout_views] for name, layout_views in views.items()}
    for part, (name, world) in enumerate(sources.worlds.items(), start=num_parts - len(sources.worlds)):
        shown[name] = list(_shown(world, sources, files, _part_of(progress, part, num_parts)))
    by_digest = sorted({key for layout_keys in shown.values() for key in layout_keys})
    number = {key: i for i, key in enumerate(by_digest)}
    return Album(
        files=dict(sorted(files.items())),
        digests=tuple(name for name, _ in by_digest),
        alts={language: tuple(words[i] for _, words in by_digest) for i, language in enumerate(sources.texts)},
        numbers={name: tuple(number[key] for key in shown[name]) for name in worlds},
    )


def _views(layout: Layout, world: DeterministicMDP) -> list[View]:
    return [egocentric_view(layout, key_door_state(world, state)) for state in range(world.num_states)]


def _said(view: View, sources: Sources) -> _Words:
    return tuple(describe(view, phrases(texts)) for texts in sources.texts.values())


def _shown(
    world: ShownWorld, sources: Sources, files: dict[str, bytes], progress: Callable[[float], None]
) -> Iterator[tuple[str, _Words]]:
    """Yield the digest and the words of each state of a world, and add its pictures to the files."""
    try:
        for state, picture in enumerate(world.pictures(progress)):
            name = digest(picture)
            files[name] = picture
            yield name, tuple(world.describe(state, language) for language in sources.texts)
    except ValueError as problem:
        raise BuildError(f"layout {world.layout!r}: {problem}") from problem


def _part_of(progress: Callable[[float], None], part: int, num_parts: int) -> Callable[[float], None]:
    """Return what reports how much of a part is done, as a share of all."""
    return lambda done: progress((part + done) / num_parts)
