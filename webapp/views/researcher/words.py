"""How the dashboard says things: states, rules, kinds of pages, tests."""

from collections.abc import Mapping

from webapp.storage.live_numbers import DropOutTest, State
from webapp.study.quality import Flag, Rule

STATES: Mapping[State, str] = {
    "consented": "consented",
    "in_progress": "in progress",
    "stalled": "stalled",
    "completed": "completed",
    "withdrawn": "left",
    "screened_out": "screened out",
}

RULES: Mapping[Rule, str] = {
    "min_total_minutes": "too fast",
    "min_seconds_per_rating_page": "rates too fast",
    "straight_lining": "straight-lining",
    "failed_attention_checks": "attention checks",
    "failed_quiz": "quiz failed",
    "duplicates": "duplicate",
    "incomplete": "incomplete",
}
"""The declared rules, short."""

PAGES: Mapping[str, str] = {
    "background": "Background questions",
    "instructions": "Instructions",
    "practice": "Practice drive",
    "quiz": "Quiz",
    "situation": "Situation",
    "first_drive": "Drive before the explanation",
    "explanation": "Explanation",
    "probe": "Predictions",
    "drive": "Drive after the explanation",
    "rating": "Ratings",
    "satisfaction": "Satisfaction scale",
}

FILES: Mapping[str, str] = {
    "ratings.csv": "One row per rating.",
    "participants.csv": "One row per participant: where they are and what was drawn for them.",
    "answers.csv": "One row per answer to a background question, the quiz or an attention check.",
    "probes.csv": "One row per prediction of the agent's next action.",
    "drives.csv": "One row per finished drive.",
    "events.csv": "One row per event in the browser and per action of a drive.",
    "allocation.csv": "One row per draw of an arrangement: what it was drawn from, and what came of the place.",
    "decisions.csv": "One row per decision about a participant: exclusions, corrections, help.",
    "quality.csv": "One row per participant and declared rule: what was found, and whether it flags them.",
    "wide.csv": "One row per participant with all of their answers side by side.",
}

_SIGNIFICANT = 0.05
_SMALLEST_P = 0.001


def flag_words(found: Flag) -> str:
    """Return a flag with what was measured and what is declared."""
    name = RULES[found.rule]
    if found.value is None:
        return name
    value = f"{found.value:.1f}".removesuffix(".0")
    return f"{name}: {value}" if found.limit is None else f"{name}: {value}, limit {found.limit:g}"


def drop_out_words(test: DropOutTest) -> str:
    """Return what a test of drop-out says, in the manner of reports."""
    statistic = f"chi-square({test.df}) = {test.statistic:.1f}"
    if test.method == "permutation":
        is_told = test.standard_error is not None and test.p_value >= _SMALLEST_P
        error = f" ± {_decimals(test.standard_error or 0.0)}" if is_told else ""
        statistic = f"permutation test of {statistic}, p {p_words(test.p_value)}{error}"
    else:
        statistic = f"{statistic}, p {p_words(test.p_value)}"
    is_sign = test.p_value < _SIGNIFICANT
    return f"{statistic}: {'drop-out differs between the arms' if is_sign else 'no sign of differential drop-out'}"


def p_words(p_value: float) -> str:
    """Return `= .68` or `< .001`."""
    return "< .001" if p_value < _SMALLEST_P else f"= {_decimals(p_value)}"


def seconds_words(seconds: float) -> str:
    """Return a duration such as `350 ms`, `4.2 s`, `1 min 05 s` or `2 h 10 min`."""
    if round(seconds * 1000) < 1000:  # noqa: PLR2004 - milliseconds of a second
        return f"{seconds * 1000:.0f} ms"
    if round(seconds) < 60:  # noqa: PLR2004 - seconds of a minute
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"  # noqa: PLR2004 - for people
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:  # noqa: PLR2004 - minutes of an hour
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def _decimals(share: float) -> str:
    digits = 2 if share >= 0.01 else 3  # noqa: PLR2004 - as reports round
    text = f"{share:.{digits}f}"
    return text.removeprefix("0") if share < 1 else text
