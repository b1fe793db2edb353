"""What the table and the picture of a stability call the things that vary."""

from webapp.explainer.stability import Count, Level, Stability
from webapp.explainer.variants import Factor, StabilitySettings

FACTOR_NAMES: dict[Factor, str] = {
    "importance": "importance",
    "random actions": "r =",
    "threshold": "threshold",
    "ties": "ties",
    "tie average": "tie average",
    "training seed": "agent",
}
_IMPORTANCES = {
    "return_probability": ("return", "return probability"),
    "ace": ("ACE", "average causal effect"),
    "reward_importance": ("reward", "reward importance"),
}
_HALF_A_PERCENT = 0.005


def level_name(level: Level, settings: StabilitySettings, *, full: bool = False) -> str:
    """Name one value of a factor.

    Args:
        level: The value.
        settings: What was tried.
        full: For a sentence that names the factor before; else the name stands alone in a narrow column.
    """
    if level.factor == "importance":
        return _IMPORTANCES[level.name][full]
    if level.factor == "random actions":
        return level.name if full else f"r={level.name}"
    if level.factor == "threshold":
        top = f"top-{settings.k}"
        return {"mean": "mean", "top-k": top, "largest-gap": "largest gap" if full else "gap"}[level.name]
    if level.factor == "ties":
        return f"{settings.num_tie_breaks} random tie-breakings" if full else "ties"
    if level.factor == "tie average":
        return "all tied actions equally likely" if full else "avg"
    return level.name


def percent(count: Count) -> str:
    """Write a share in whole per cent; 0 and 100 stand for none and all and nothing else."""
    if 0 < count.share <= _HALF_A_PERCENT:
        return "<1"
    if 1 - _HALF_A_PERCENT <= count.share < 1:
        return ">99"
    return f"{100 * count.share:.0f}"


def num_ways(found: Stability) -> str:
    """Say how many variants there are."""
    return "1 way" if len(found.variants) == 1 else f"{len(found.variants)} ways"
