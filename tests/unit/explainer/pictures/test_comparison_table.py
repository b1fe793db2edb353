import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rich.console import Console

from tests.worlds import LAYOUTS
from webapp.explainer.comparison import SELECTORS, Comparison, ComparisonSettings, Measure, compare
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.comparison_table import ComparisonReport
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.stochastic import from_outcomes
from webapp.explainer.worlds.key_door import tabulate


@cache
def simulation(budget: int | None) -> Comparison:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    return compare(mdp, policy, follow(mdp, policy), ComparisonSettings(budget=budget, num_draws=3, alpha=0.123456))


@cache
def slippery(label: str) -> Comparison:
    """Compare where each of three steps forward fails half of the time."""
    outcomes = [(s, 0, after, 0.5) for s in range(3) for after in (s, s + 1)] + [(s, 1, 0, 1.0) for s in range(3)]
    goal = np.arange(4) == 3
    labels = [f"{label}{state}" for state in range(4)]
    world = from_outcomes(labels, ["go", "back"], outcomes, terminal=goal, goal=goal, start=0)
    policy = np.zeros(4, dtype=np.int32)
    return compare(world, policy, Trajectory((0, 1, 2, 3), (0, 0, 0)), ComparisonSettings(budget=3, num_draws=2))


def printed(comparison: Comparison, width: int, encoding: str = "utf-8", title: str = "a map") -> str:
    """Print to a terminal that refuses characters which it does not have."""
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding, errors="strict")
    Console(file=file, width=width).print(ComparisonReport(comparison, title, "asked for"))
    file.flush()
    return raw.getvalue().decode(encoding)


@pytest.mark.parametrize("width", [60, 61, 65, 70, 79, 80, 100, 120, 200])
@pytest.mark.parametrize("encoding", ["ascii", "utf-8", "latin-1"])
@pytest.mark.parametrize("budget", [None, 1, 19, 20, "slippery"])
def test_nothing_is_cut_at_any_width_in_any_encoding(width: int, encoding: str, budget: int | str | None) -> None:
    comparison = slippery("s") if isinstance(budget, str) else simulation(budget)
    output = printed(comparison, width, encoding)
    assert max(map(len, output.splitlines())) <= width
    assert "…" not in output
    words = " ".join(output.split())
    for rating in comparison.ratings:
        chosen = "mean of draws" if rating.steps is None else ", ".join(map(str, rating.steps))
        assert f"{rating.selector} {chosen} " in words.replace("(", "").replace(")", "") + " "
        assert f"of {comparison.budget} {rating.fidelity.value:.3f}" in words or rating.fidelity.value < 0.0005
    assert "first k above" in output


def test_at_the_narrowest_an_error_stands_below_its_mean() -> None:
    narrow, wide = printed(simulation(20), 60), printed(simulation(20), 80)
    assert "1.000 ±0.000" in wide
    wider = printed(simulation(3), 80).splitlines()
    assert any(line.startswith("subgoals        7, 16, 20  ") for line in wider)
    assert not any(line.startswith("subgoals        7, 16, 20  ") for line in narrow.splitlines())
    cramped = printed(simulation(3), 56).splitlines()
    assert any(line.strip().startswith("±") for line in cramped)


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
@pytest.mark.parametrize("width", [60, 80, 120])
def test_steps_that_only_fill_the_budget_stand_in_brackets(width: int, encoding: str) -> None:
    comparison = simulation(5)
    assert comparison.ratings[0].fillers
    words = " ".join(printed(comparison, width, encoding).split())
    for rating in comparison.ratings:
        if rating.steps is None:
            continue
        first = f"({rating.steps[0]}" if rating.steps[0] in rating.fillers else f"{rating.steps[0]}"
        line = words[words.index(f"{rating.selector} {first}") :]
        inside, seen = False, []
        for word in line.removeprefix(rating.selector).split()[:5]:
            inside = inside or word.startswith("(")
            seen.append((int(word.strip("(),")), inside))
            inside = inside and ")" not in word
        assert seen == [(step, step in rating.fillers) for step in rating.steps]
    assert words.count("in brackets: filled up to k; the method names no such step.") == 1


def test_without_a_filler_no_brackets_are_explained() -> None:
    comparison = replace(simulation(3), ratings=tuple(replace(each, fillers=()) for each in simulation(3).ratings))
    assert "brackets" not in printed(comparison, 80)
    assert "(" not in printed(comparison, 80).split("overlap:")[0]


def test_an_interval_that_was_not_kept_is_told_below_the_table() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    found = compare(mdp, policy, follow(mdp, policy), ComparisonSettings(budget=3, num_draws=2, min_gap=30))
    words = " ".join(printed(found, 60).split())
    assert "highlights: 3 steps, the most important first, do not fit 30 apart; they are kept 8 apart." in words


def chancy(alpha: float, *, detour: bool) -> Comparison:
    """Compare where one step arrives half of the time, or else leads to a side from which the policy returns."""
    goal = np.arange(3) == 2
    side = 1 if detour else 0
    outcomes = [(0, 0, 2, 0.5), (0, 0, side, 0.5), (0, 1, 0, 1.0), (1, 0, 2, 1.0), (1, 1, 0, 1.0), (1, 2, 0, 1.0)]
    world = from_outcomes(
        "abc", ["go", "stay", "stay too"], [*outcomes, (0, 2, 0, 1.0)], terminal=goal, goal=goal, start=0
    )
    policy = np.zeros(3, dtype=np.int32)
    return compare(world, policy, Trajectory((0, 2), (0,)), ComparisonSettings(alpha=alpha, num_draws=2))


def test_where_no_k_exceeds_alpha_the_policys_own_chance_explains_it() -> None:
    words = " ".join(printed(chancy(0.8, detour=False), 80).split())  # 1 - 1/2 * 1/2
    assert (
        "none: the policy, followed everywhere, reaches the goal within 2 actions with probability 0.75; "
        "even that does not exceed 0.8."
    ) in words
    words = " ".join(printed(chancy(0.7, detour=True), 80).split())  # 1/2 + 1/2 * 1/3 on the path alone
    assert (
        "none: k = 1 gives 0.667, no more than 0.7; the policy, followed off the path too, "
        "reaches the goal within 2 actions with probability 1."
    ) in words
    assert "none:" not in printed(chancy(0.6, detour=True), 80)
    assert "A path of 1 step. " in words


@pytest.mark.parametrize(
    ("value", "text"), [(-0.0, "0.000"), (2e-8, "2e-08"), (-0.0004, "-4e-04"), (-0.25, "-0.250"), (0.0, "0.000")]
)
def test_a_small_number_keeps_its_magnitude_and_nothing_has_no_sign(value: float, text: str) -> None:
    ratings = tuple(replace(each, drop=Measure(value)) for each in simulation(3).ratings)
    rows = printed(replace(simulation(3), ratings=ratings), 100).splitlines()
    assert sum(text in row.split() for row in rows) == len(SELECTORS)
    assert not any("-0.000" in row for row in rows)


def test_the_landmark_facts_are_named_and_so_are_the_sources() -> None:
    words = " ".join(printed(simulation(3), 80).split())
    assert "landmark facts chosen: step 7 has_key = 1; step 14 door_open = 1; step 15 " in words
    assert "highlights: Amir & Amir 2018, AAMAS" in words
    assert "of all that may happen" not in words


def test_in_a_stochastic_world_the_graph_and_the_policys_own_chance_are_told() -> None:
    words = " ".join(printed(slippery("s"), 80).split())
    assert "bottlenecks: of all that may happen, however unlikely." in words
    assert "falls from 0.656 when" in words  # At least 3 heads in 6 tosses: 42 of 64.
    assert "landmark facts chosen: step 1 state = s1; step 2 state = s2; step 3 state = s3." in words


def test_a_label_that_the_terminal_cannot_write_is_escaped() -> None:
    assert "state = tür1" in printed(slippery("tür"), 80)
    assert "state = t\\xfcr1" in printed(slippery("tür"), 80, "ascii")
    assert "\\u2026" in printed(slippery("s"), 80, "ascii", title="a … map")


def test_every_selector_has_a_line_in_each_table() -> None:
    lines = printed(simulation(3), 100).splitlines()
    for name in SELECTORS:
        assert sum(line.startswith(f"{name}  ") for line in lines) == 2


def test_a_long_curve_is_thinned_and_keeps_both_ends() -> None:
    goal = np.arange(101) == 100
    table = np.minimum(np.arange(101)[:, None] + 1, 100).astype(np.int32)
    mdp = DeterministicMDP(tuple(range(101)), ("go",), table, goal, goal, 0)
    policy = plan(mdp)
    comparison = compare(mdp, policy, follow(mdp, policy), ComparisonSettings(num_draws=2))
    rows = [line for line in printed(comparison, 60, "ascii").splitlines() if "#" in line]
    assert len(rows) == len(SELECTORS)
    assert all(row.count("#") > 5 for row in rows)  # With one action nothing can go wrong.


def test_curves_that_stay_low_are_drawn_to_their_own_scale() -> None:
    low = replace(
        simulation(3),
        ratings=tuple(
            replace(rating, curve=tuple(replace(each, value=each.value / 50) for each in rating.curve))
            for rating in simulation(3).ratings
        ),
    )
    words = printed(low, 80)
    assert "fidelity (0 to 0.02) for k = 0 to 20" in words
    assert words.count("█") == len(SELECTORS)
    assert "fidelity (0 to 1) for k = 0 to 20" in printed(simulation(3), 80)
