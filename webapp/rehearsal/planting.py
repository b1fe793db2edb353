"""What is planted: which effects bots have, and what a report should therefore find."""

from collections.abc import Sequence

from webapp.bots.effects import Effects, parse_effects
from webapp.study.analysis_plan import Contrast, Plan
from webapp.study.protocol import Study

DEFAULT_EFFECT = 1.0
"""Of the first kind of each experiment's first contrast if nothing is said: large enough for 60 people to show it."""


def planted_effects(texts: Sequence[str], study: Study, plan: Plan) -> Effects:
    """Return the effects that were asked for, or else the default ones.

    Args:
        texts: Such as `subgoals=0.5`, as `xar bots` takes them.
        study: The study.
        plan: Its planned contrasts.

    Raises:
        BotError: One cannot be read, or names what the study does not have.
    """
    return parse_effects(texts or default_effects(plan), study)


def default_effects(plan: Plan) -> tuple[str, ...]:
    """Return the default as texts: the first kind of each experiment's first contrast is rated higher."""
    focal: dict[str, str] = {}
    for contrast in plan.contrasts:
        focal.setdefault(contrast.experiment, contrast.first)
    return tuple(f"{kind}={DEFAULT_EFFECT:g}" for kind in dict.fromkeys(focal.values()))


def planted_difference(effects: Effects, contrast: Contrast, item: str) -> float:
    """Return the planted d of a contrast on an item: a bot's latent rating has the standard deviation 1."""
    return effects.on_rating(contrast.first, item) - effects.on_rating(contrast.second, item)


def told(effects: Effects) -> tuple[str, ...]:
    """Return effects as texts, such as `subgoals=1`."""
    return tuple(
        f"{kind}{'.' if target else ''}{target}={delta:g}" for (kind, target), delta in sorted(effects.shifts.items())
    )
