"""Every view that can be reached, as a picture and in words, each once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.render import digest, draw
from webapp.explainer.pictures.words import describe
from webapp.explainer.worlds.key_door import key_door_state
from webapp.explainer.worlds.layout import Layout
from webapp.explainer.worlds.view import View, egocentric_view
from webapp.stimuli.sources import Sources, phrases


@dataclass(frozen=True, slots=True)
class Album:
    """The pictures of a bundle, numbered in the order of their digests.

    Attributes:
        files: The PNG bytes, by digest.
        alts: By language, the words for each picture, in the order of the numbers.
        numbers: By layout, the number of the picture of each state `[S]` of the layout's table.
    """

    files: Mapping[str, bytes]
    alts: Mapping[str, tuple[str, ...]]
    numbers: Mapping[str, tuple[int, ...]]


def draw_album(sources: Sources, worlds: Mapping[str, DeterministicMDP], progress: Callable[[float], None]) -> Album:
    """Draw the view of every state of every layout.

    Args:
        sources: The study's layouts and texts.
        worlds: By layout, the table of the world that `numbers` refers to.
        progress: Is told how much is done, from 0 to 1.
    """
    views = {name: _views(sources.layouts[name], world) for name, world in worlds.items()}
    distinct = list(dict.fromkeys(view for layout_views in views.values() for view in layout_views))
    pictures: dict[View, bytes] = {}
    for done, view in enumerate(distinct, start=1):
        pictures[view] = draw(view)
        progress(done / len(distinct))
    by_digest = sorted((digest(picture), view) for view, picture in pictures.items())
    number = {view: i for i, (_, view) in enumerate(by_digest)}
    return Album(
        files={name: pictures[view] for name, view in by_digest},
        alts={
            language: tuple(describe(view, phrases(texts)) for _, view in by_digest)
            for language, texts in sources.texts.items()
        },
        numbers={name: tuple(number[view] for view in layout_views) for name, layout_views in views.items()},
    )


def _views(layout: Layout, world: DeterministicMDP) -> list[View]:
    return [egocentric_view(layout, key_door_state(world, state)) for state in range(world.num_states)]
