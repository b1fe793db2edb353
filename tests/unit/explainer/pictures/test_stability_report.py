import io
import re
from functools import cache

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

from tests.unit.explainer.test_tie_breaking import open_floor
from tests.worlds import LAYOUTS
from webapp.explainer.pictures.stability_names import level_name, percent
from webapp.explainer.pictures.stability_report import StabilityReport, verdict
from webapp.explainer.solvers import follow, plan
from webapp.explainer.stability import Count, Stability, stability
from webapp.explainer.tie_breaking import random_tie_break, shortest_path_actions
from webapp.explainer.variants import OtherAgent, StabilitySettings
from webapp.explainer.worlds.key_door import tabulate


@cache
def found(name: str = "simulation", num_agents: int = 0) -> Stability:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    path, optimal = follow(mdp, policy), shortest_path_actions(mdp)
    agents = [
        OtherAgent(f"seed {seed}", mdp, random_tie_break(optimal, policy, path, seed, 1)) for seed in range(num_agents)
    ]
    asked = StabilitySettings(random_step_counts=(5, 20), num_tie_breaks=10)
    return stability(mdp, policy, path, asked, agents=agents)


@cache
def floor_with_stranger() -> Stability:
    mdp = open_floor()
    optimal = shortest_path_actions(mdp)
    last_first = np.where(optimal.any(axis=1), 3 - optimal[:, ::-1].argmax(axis=1), 0).astype(np.int32)
    agents = [OtherAgent("seed 1", mdp, last_first)]
    return stability(mdp, plan(mdp), follow(mdp, plan(mdp)), StabilitySettings(num_tie_breaks=2), agents=agents)


@cache
def alone() -> Stability:
    mdp = open_floor()
    asked = StabilitySettings(num_tie_breaks=0, random_step_counts=(), rules=())
    return stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked)


def printed(of: Stability, width: int = 80, *, encoding: str = "utf-8", terminal: bool = False) -> list[str]:
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding, newline="\n")
    console = Console(file=file, width=width, force_terminal=terminal, _environ={"TERM": "xterm"})
    console.print(StabilityReport(of, "simulation", "of the table"))
    file.flush()
    return [line.rstrip() for line in raw.getvalue().decode(encoding).splitlines()]


def rows(lines: list[str]) -> dict[int, str]:
    """The lines of the table by their step."""
    matches = [re.match(r"^ {2,3}(\d+) ", line) for line in lines]
    return {int(match[1]): line for match, line in zip(matches, lines, strict=True) if match}


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_each_step_that_is_ever_a_subgoal_has_a_row_and_the_others_a_line(width: int) -> None:
    lines = printed(found(), width)
    ever = {step.step for step in found().steps if step.overall.count}
    assert set(rows(lines)) == ever
    assert f"{20 - len(ever)} of 20 steps are never a subgoal and are left out." in lines
    for step, line in rows(lines).items():
        stable = found().steps[step - 1]
        assert stable.action in line
        assert ("○" in line) == stable.is_subgoal == (step in (7, 16, 20))
        assert ("▲ flips" in line) == bool(stable.flips)
        assert line.endswith("holds") == (stable.is_subgoal and not stable.flips)


@pytest.mark.parametrize("width", [80, 120])
def test_where_there_is_room_shares_are_percentages_by_choice(width: int) -> None:
    lines = printed(found(), width)
    (head,) = [line for line in lines if "r=5" in line]
    names = ["r=5", "r=10", "r=20", "mean", "top-3", "gap", "ties", "avg"]
    assert re.findall("|".join(names), head) == names
    for step, line in rows(lines).items():
        stable = found().steps[step - 1]
        numbers = re.findall(r"[<>]?\d+", line)[1:]
        assert numbers == [percent(count) for count in (stable.overall, *stable.by_level)]
        assert line.count("█") == (round(10 * stable.overall.share) if width == 120 else 0)


def test_where_there_is_none_a_share_is_one_character() -> None:
    lines = printed(found(), 60, encoding="ascii")
    for step, line in rows(lines).items():
        stable = found().steps[step - 1]
        cells = re.split(r" {2,}", line.strip())[3 if stable.is_subgoal else 2 :]
        assert cells[0] == percent(stable.overall)
        drawn = "".join(cells[1:5])
        assert len(drawn) == len(stable.by_level) == 8
        for character, count in zip(drawn, stable.by_level, strict=True):
            if count.count in (0, count.total):
                assert character == ("#" if count.count else ".")
            else:
                assert int(character) == min(9, 1 + int(9 * count.share))
    assert "r: r=5, r=10, r=20, one character each." in lines
    assert ". none, 1 to 9 some, # all." in " ".join(lines)


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
@pytest.mark.parametrize("width", [60, 80, 100, 140, 200])
@pytest.mark.parametrize("num_agents", [0, 4])
def test_no_line_is_wider_than_the_console_and_nothing_is_coloured(width: int, encoding: str, num_agents: int) -> None:
    lines = printed(found(num_agents=num_agents), width, encoding=encoding)
    assert all(cell_len(line) <= width for line in lines)
    assert "\x1b" not in "\n".join(lines)
    assert "…" not in "\n".join(lines)


def test_a_terminal_gets_colours_and_the_same_words() -> None:
    coloured = "\n".join(printed(found(), 120, terminal=True))
    assert "\x1b[" in coloured
    assert [line.rstrip() for line in re.sub(r"\x1b\[[0-9;]*m", "", coloured).splitlines()] == printed(found(), 120)


def test_it_says_first_what_was_tried() -> None:
    lines = " ".join(printed(found(num_agents=2), 200))
    assert lines.startswith("simulation of the table  A path of 20 steps, explained in 126 ways: r = 5, 10 and 20; ")
    assert "threshold mean, top-3 and largest gap; 10 random tie-breakings; all tied actions equally likely; " in lines
    assert "agent seed 0 and seed 1." in lines


def test_the_verdict_counts_what_holds_and_names_what_makes_the_rest_flip() -> None:
    said = verdict(found("experiment1-a"))
    stable = found("experiment1-a").steps
    holding = [step for step in stable if step.is_subgoal and not step.flips]
    assert said[0].startswith(f"{len(holding)} of 3 subgoals hold")
    for step in stable:
        (sentence,) = [each for each in said if each.startswith(f"Step {step.step} (")] or [""]
        assert bool(sentence) == bool(step.flips)
        factors = {flip.factor for flip in step.flips}
        assert ("threshold largest gap (1 of 2 other ways)" in sentence) == ("threshold" in factors)
        assert ("several choices differ at once" in sentence) == (None in factors)
        if sentence:
            assert ("a subgoal, flips: it is none" in sentence) == step.is_subgoal
            assert ("no subgoal, flips: it is one" in sentence) != step.is_subgoal


def test_what_holds_as_long_as_one_choice_differs_is_counted_apart() -> None:
    together = [step for step in found().steps if step.is_subgoal and step.flips and step.flips[0].factor is None]
    assert together
    (said,) = [each for each in verdict(found()) if each.startswith("As long as only one choice differs")]
    assert f", {len(together)} more hold: " in said
    assert re.findall(r"step (\d+)", said) == [str(step.step) for step in together]


def test_random_draws_are_told_with_their_interval() -> None:
    assert verdict(found())[-1] == (
        "Where only ties are broken otherwise, subgoals stay as follows: "
        "step 7, 16 and 20 in 10 of 10 draws (95% interval 72% to 100%)."
    )


def test_subgoals_off_the_path_are_named_and_the_agent_is_blamed() -> None:
    said = " ".join(verdict(floor_with_stranger()))
    ((state, action), count), *_ = floor_with_stranger().elsewhere
    assert isinstance(state, tuple)
    assert "with agent seed 1 (1 of 1 other ways)" in said
    assert f"Subgoals that are not on this path, and in how many ways: {action} in {state} ({count.count})" in said


def test_where_all_holds_it_says_so() -> None:
    mdp = open_floor()
    calm = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), StabilitySettings(num_tie_breaks=0, rules=("mean",)))
    assert verdict(calm) == ("1 of 1 subgoal holds in all 4 ways: step 6 (south).", "No other step flips.")


def test_where_nothing_was_tried_it_says_so() -> None:
    lines = printed(alone())
    assert "A path of 6 steps, explained in 1 way." in lines
    assert lines[-1] == "Nothing was tried beside the explanation itself."


@pytest.mark.parametrize(
    ("count", "total", "written"),
    [
        (0, 400, "0"),
        (1, 400, "<1"),
        (2, 400, "<1"),
        (3, 400, "1"),
        (397, 400, "99"),
        (398, 400, ">99"),
        (400, 400, "100"),
        (1, 3, "33"),
    ],
)
def test_nought_and_a_hundred_per_cent_mean_none_and_all(count: int, total: int, written: str) -> None:
    assert percent(Count(count, total)) == written


def test_every_value_of_a_choice_has_a_short_and_a_full_name() -> None:
    mdp = open_floor()
    asked = StabilitySettings(importances=("ace", "reward_importance"), num_tie_breaks=2)
    every = stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked, agents=[OtherAgent("seed 1", mdp, plan(mdp))])
    assert [level_name(level, every.settings) for level in every.levels] == [
        *("return", "ACE", "reward", "r=5", "r=10", "r=20", "r=40", "mean", "top-1", "gap", "ties", "avg", "seed 1")
    ]
    assert [level_name(level, every.settings, full=True) for level in every.levels] == [
        *("return probability", "average causal effect", "reward importance", "5", "10", "20", "40", "mean", "top-1"),
        *("largest gap", "2 random tie-breakings", "all tied actions equally likely", "seed 1"),
    ]
