"""What the importance experiment varies: two maps, the random actions, the trials, and what is compared."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from webapp.explainer.importance import PROBABILITY_KINDS, ProbabilityKind
from webapp.explainer.questioner import Belief, mistaken_route
from webapp.explainer.stop_rule import StopRule
from webapp.explainer.worlds.key_door import start_state, tabulate
from webapp.explainer.worlds.layout import Layout, parse_layout
from webapp.simulations.tasks import packaged_layout


@dataclass(frozen=True, slots=True)
class ImportanceSettings:
    """What one run of the experiment computes.

    Attributes:
        layout: The map, drawn in ASCII.
        layout_name: What to call it.
        believed_layout: The map that the questioner takes for the real one, drawn in ASCII; None when nobody asks.
        seed: Of the sampling and of the training, at least 0.
        random_steps: r, at least 0.
        num_trials: Rollouts per state and probability, from 1 to 1,000,000.
        learned: Whether the trained agent and its world model are explained, too.
        importances: Which definitions are compared, in the order of the figure's panels.

    Raises:
        LayoutError: A map cannot be used, or the goal cannot be reached on it.
        ValueError: A number is out of range, or an importance is named twice, not at all, or cannot be sampled.
    """

    layout: str
    layout_name: str
    believed_layout: str | None = None
    seed: int = 2021
    random_steps: int = 10
    num_trials: int = 1000
    learned: bool = True
    importances: tuple[ProbabilityKind, ...] = PROBABILITY_KINDS

    def __post_init__(self) -> None:
        for name in ("seed", "random_steps"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must be 0 or larger, not {getattr(self, name)}")
        StopRule(self.num_trials)
        if not self.importances or len(set(self.importances)) < len(self.importances):
            raise ValueError(f"name one or more different importances, not {self.importances}")
        for kind in self.importances:
            if kind not in PROBABILITY_KINDS:
                raise ValueError(f"{kind!r} is nothing that can be sampled; use {' or '.join(PROBABILITY_KINDS)}")
        tabulate(self.map, self.layout_name)
        _ = self.route  # A belief that does not fit is refused now and not after the training.

    @property
    def map(self) -> Layout:
        """The map itself."""
        return parse_layout(self.layout, self.layout_name)

    @property
    def belief(self) -> Belief | None:
        """What the questioner believes, if somebody asks."""
        if self.believed_layout is None:
            return None
        source = f"the believed map of {self.layout_name}"
        return Belief(parse_layout(self.believed_layout, source), source)

    @property
    def route(self) -> tuple[int, ...] | None:
        """The questioner's action indices from the start (`a_bad`), a shortest path on the believed map."""
        belief = self.belief
        return None if belief is None else mistaken_route(self.map, belief, start_state(self.map))

    @property
    def is_the_papers_map(self) -> bool:
        """Whether the paper's statements are about this map."""
        return self.map == parse_layout(packaged_layout())

    @property
    def is_the_papers_question(self) -> bool:
        """Whether the paper's statements are about this map and this misunderstanding."""
        belief = self.belief
        return self.is_the_papers_map and belief is not None and str(belief.layout) == _misunderstood(self.layout)

    def to_dict(self) -> dict[str, object]:
        """Return every setting by name, made of text, numbers and lists only."""
        return dataclasses.asdict(self) | {"importances": list(self.importances)}


def _misunderstood(layout: str) -> str:
    """Draw the map of section 5.1's questioner, who has the door in another place; the place itself is ours."""
    return str(parse_layout(layout).with_door_at((4, 2)))


def _preset(num_trials: int, *, learned: bool = True) -> ImportanceSettings:
    layout = packaged_layout()
    return ImportanceSettings(layout, "simulation", _misunderstood(layout), num_trials=num_trials, learned=learned)


SETTINGS: Mapping[str, ImportanceSettings] = {
    "paper": _preset(1_000),
    "ours": _preset(10_000),
    "quick": _preset(200, learned=False),
}
"""By preset. The paper gives neither the number of trials nor that of random actions, so that both are ours in all.

The quick one takes a second; with the training of an agent it would take half a minute on a busy machine.
"""
