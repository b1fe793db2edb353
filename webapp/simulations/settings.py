"""What the two learning experiments share of their settings."""

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from webapp.explainer.learning.fresh_settings import FreshSettings
from webapp.simulations.conditions import VARIANTS, Variant
from webapp.simulations.tasks import packaged_layout

PRESETS = ("paper", "ours", "quick")
"""The paper's ten runs per condition, thirty, or a few that show within seconds that everything works."""


@dataclass(frozen=True, slots=True)
class SweepSettings:
    """The settings of one sweep of learning runs.

    Attributes:
        layout: The map's text.
        layout_name: What to call it.
        seed: Of all that is drawn, at least 0.
        num_runs: Agents per condition, at least 2: fewer have no spread.
        variants: Which of the ways to pay a sub-reward are tried.
        runs_per_stack: How many runs make up a unit of work, a stack with the queue behind it. Units of twice the
            stack's width waste little at the end and finish often enough to tell how long the rest will take.
        margin: Two conditions count as equivalent if the ratio of their interquartile means lies, with its 90 %
            interval, within 1 + margin and its inverse. Ours: the paper takes what is not significant for equal.
        num_resamples: Of the bootstrap.
        fresh: How the agents learn.

    Raises:
        ValueError: A number is out of range; the message names it.
    """

    layout: str = field(default_factory=packaged_layout)
    layout_name: str = "simulation"
    seed: int = 2021
    num_runs: int = 10
    variants: tuple[Variant, ...] = ("repeatable", "once")
    runs_per_stack: int = 32
    margin: float = 0.25
    num_resamples: int = 10_000
    fresh: FreshSettings = field(default_factory=lambda: FreshSettings(num_slots=16))

    def __post_init__(self) -> None:
        for name, least in (("seed", 0), ("num_runs", 2), ("runs_per_stack", 1), ("num_resamples", 100)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be {least} or larger, not {getattr(self, name)}")
        if not 0 < self.margin < 1:
            raise ValueError(f"margin must lie between 0 and 1, not {self.margin}")
        known = [variant for variant in VARIANTS if variant != "none"]
        if not self.variants or set(self.variants) - set(known):
            raise ValueError(f"variants must be some of {', '.join(known)}, not {', '.join(self.variants) or 'none'}")

    def to_dict(self) -> dict[str, object]:
        """Return every setting by name, ready for JSON."""
        return dataclasses.asdict(self) | {"variants": list(self.variants)}


QUICK_LAYOUT = """\
#######
#K.#..#
#..#..#
#..D..#
#.^#.G#
#######
"""
QUICK: dict[str, Any] = {
    "layout": QUICK_LAYOUT,
    "layout_name": "quick",
    "num_runs": 4,
    "runs_per_stack": 16,
    "num_resamples": 500,
    "fresh": FreshSettings(
        num_slots=16, max_episodes=40, exploration_steps=6000, warmup_steps=200, target_interval=200
    ),
}
"""A small map and few runs: everything happens, and nothing can be concluded."""
