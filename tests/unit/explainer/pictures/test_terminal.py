import io

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.explanation import Explanation, explain
from webapp.explainer.importance import Importance, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.sentences import load_phrases, subgoal_sentences
from webapp.explainer.pictures.terminal import Report
from webapp.explainer.questioner import Belief, mistaken_route
from webapp.explainer.solvers import Trajectory, plan
from webapp.explainer.worlds.key_door import start_state, tabulate
from webapp.explainer.worlds.layout import Layout

CORRIDOR = lay_out("#######", "#>KD.G#", "#######")


def with_importance(
    layout: Layout, values: list[float], errors: list[float] | None = None, route: str | None = None
) -> Report:
    mdp = tabulate(layout)
    known = Importance(np.array(values), None if errors is None else np.array(errors))
    actions = None if route is None else [mdp.actions.index(action) for action in route.split()]
    found = explain(mdp, plan(mdp), lambda path: known, actions)  # noqa: ARG005 - the importance is given.
    return Report(layout, mdp, found, "corridor", "made up")


def simulation(route: str | None = None) -> Report:
    layout = LAYOUTS["simulation"]
    mdp = tabulate(layout)
    policy = plan(mdp)
    assess = lambda path: exact_importance("return_probability", mdp, policy, path, 10)
    actions = None if route is None else [mdp.actions.index(action) for action in route.split()]
    return Report(layout, mdp, explain(mdp, policy, assess, actions), "simulation", "exactly")


def printed(report: Report, width: int = 80, *, encoding: str = "utf-8", terminal: bool = False) -> list[str]:
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding, newline="\n")
    Console(file=file, width=width, force_terminal=terminal, _environ={"TERM": "xterm"}).print(report)
    file.flush()
    return [line.rstrip() for line in raw.getvalue().decode(encoding).splitlines()]


def test_the_path_is_drawn_leg_by_leg_up_to_each_subgoal() -> None:
    drawn = printed(with_importance(CORRIDOR, [0.9, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0]))
    assert drawn[3:7] == [
        "1. step 1        2. steps 2-4     3. steps 5-6",
        "██████████████   ██████████████   ██████████████",
        "██→ K D · G ██   ██→ → → · G ██   ██· · → → G ██",
        "██████████████   ██████████████   ██████████████",
    ]


def test_the_key_is_drawn_until_it_is_in_hand() -> None:
    report = simulation()
    start_of_maps = printed(report)[3:6]
    assert "K" in start_of_maps[2].split("   ")[0]
    assert all("K" not in part for part in start_of_maps[2].split("   ")[1:])


def test_every_step_has_a_line_with_its_number_and_its_importance() -> None:
    report = simulation()
    lines = printed(report)
    values, path = report.explanation.importance.values, report.explanation.path
    for step, (state, action) in enumerate(path.pairs, start=1):
        label = report.mdp.states[state]
        assert isinstance(label, tuple)
        (line,) = [line for line in lines if line.startswith(f"{step:4d}  ")]
        assert f"{label[0]},{label[1]} {'→↓←↑'[label[2]]}" in line
        assert report.mdp.actions[action] in line
        assert f"{values[step - 1]:.3f}" in line
        assert ("key" in line.split("  ")) == bool(label[3])
        assert ("○ subgoal" in line) == (step in (7, 16, 20))


@pytest.mark.parametrize("width", [80, 120])
def test_bars_are_as_long_as_importance_is_high(width: int) -> None:
    lines = printed(with_importance(CORRIDOR, [1.0, 0.5, 0.25, 0.0, 0.0, 0.0, 0.0]), width)
    bars = [line.count("█") for line in lines if line[:4].strip().isdecimal()]
    full = bars[0]
    assert bars == [full, full // 2, full // 4, 0, 0, 0]
    assert full >= 20
    assert all("┊" in line for line in lines if line[:4].strip() in ("4", "5", "6"))


def test_a_standard_error_stands_beside_its_estimate() -> None:
    lines = printed(with_importance(CORRIDOR, [0.5] * 6 + [0.0], [0.016] * 6 + [0.0]))
    assert sum("0.500 ±0.016" in line for line in lines) == 6


def test_a_route_is_drawn_and_what_it_misses_is_said() -> None:
    report = simulation("forward forward forward forward forward left pickup left forward left forward toggle")
    text = "\n".join(printed(report, 120))
    assert "the route asked" in text
    assert text.count("★ explanation") == text.count("● key point") == text.count("○ subgoal") == 1
    assert "That route does not reach the goal. It misses step 16 (forward) and step 20 (forward)." in text
    assert "★ Explanation: step 16, forward at (4, 4), facing right, with the key, the door open." in text


def test_a_route_that_arrives_misses_nothing() -> None:
    text = "\n".join(
        printed(with_importance(CORRIDOR, [0.9] + [0.0] * 6, route="pickup forward toggle" + " forward" * 3))
    )
    assert "That route reaches the goal, so it misses nothing." in text


def test_a_route_that_takes_every_subgoal_but_does_not_arrive_is_said_so() -> None:
    text = "\n".join(printed(with_importance(CORRIDOR, [0.9] + [0.0] * 6, route="pickup left")))
    assert "That route does not reach the goal, and misses none of the subgoals ahead." in text


def test_a_path_without_subgoals_is_one_leg() -> None:
    lines = printed(with_importance(CORRIDOR, [0.0] * 7))
    assert lines[3] == "1. steps 1-6"
    assert lines[-1].endswith("Subgoals: none.")


def test_what_is_not_a_terminal_gets_no_colours() -> None:
    assert "\x1b" not in "".join(printed(simulation()))
    assert "\x1b" in "".join(printed(simulation(), terminal=True))


def test_a_console_without_unicode_gets_ascii() -> None:
    text = "\n".join(printed(simulation("left left"), encoding="ascii"))
    assert "####" in text
    assert "! explanation" in text


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_no_line_is_wider_than_the_console(width: int) -> None:
    assert all(len(line) <= width for line in printed(simulation("left toggle"), width))


def test_a_map_too_wide_for_the_console_is_drawn_with_narrow_cells() -> None:
    wide = lay_out("#" * 50, "#>KD" + "." * 44 + "G#", "#" * 50)
    mdp = tabulate(wide)
    policy = plan(mdp)
    found = explain(mdp, policy, lambda path: exact_importance("ace", mdp, policy, path, 3))
    lines = printed(Report(wide, mdp, found, "wide", "exactly"))
    assert any(line.startswith("█" * 50) for line in lines)
    assert all(len(line) <= 80 for line in lines)


def test_only_key_door_worlds_can_be_drawn() -> None:
    end = np.array([False, True])
    other = DeterministicMDP(("a", "b"), ("go",), np.array([[1], [1]], dtype=np.int32), end, end.copy(), 0)
    nothing = Explanation(Trajectory((0, 1), (0,)), Importance(np.zeros(2), None), (), None, 1, ())
    with pytest.raises(TypeError, match="'a' is no state of one"):
        printed(Report(CORRIDOR, other, nothing, "other", "not a map"))


def mistaken(language: str = "en") -> Report:
    layout = LAYOUTS["simulation"]
    belief = Belief(layout.with_door_at((4, 2)), "another door")
    mdp = tabulate(layout)
    policy = plan(mdp)
    route = mistaken_route(layout, belief, start_state(layout))
    found = explain(mdp, policy, lambda path: exact_importance("return_probability", mdp, policy, path, 10), route)
    told = subgoal_sentences(layout, mdp, found, load_phrases(language))
    return Report(layout, mdp, found, "simulation", "exactly", belief, told)


def test_a_believed_route_is_drawn_on_the_believed_map_and_on_the_real_one() -> None:
    lines = printed(mistaken(), 120)
    maps = [line.split("   ")[-2:] for line in lines[4:12]]
    assert [believed for believed, _ in maps] == [
        "████████████████",
        "██K ↓ · ██· · ██",
        "██· → → → → ↓ ██",
        "██· ↑ · ██· ↓ ██",
        "██· ↑ · ██· ↓ ██",
        "██· ↑ · ██· ↓ ██",
        "██· ↑ · ██· G ██",
        "████████████████",
    ]
    assert maps[2][1] == "██· → ↓ ██· · ██"
    assert maps[4][1] == "██· ↑ ↓ D · · ██"
    assert lines[3].split()[-6:] == ["as", "believed", "what", "comes", "of", "it"]


@pytest.mark.parametrize("language", ["en", "ja"])
@pytest.mark.parametrize("width", [40, 80, 120])
def test_sentences_are_no_wider_than_the_console_and_lose_no_letter(width: int, language: str) -> None:
    report = mistaken(language)
    lines = printed(report, width)
    assert all(cell_len(line) <= width for line in lines)
    text = "".join("".join(lines).split())
    for mark, told in zip("○★●", report.sentences.values(), strict=True):
        assert f"{mark}{''.join(told.split())}" in text


def test_a_subgoal_that_nobody_asks_about_is_told_with_its_own_mark() -> None:
    layout = LAYOUTS["simulation"]
    plain = simulation()
    told = {7: "the first", 16: "the second"}
    lines = printed(Report(layout, plain.mdp, plain.explanation, "simulation", "exactly", None, told))
    assert "○ the first" in lines
    assert "○ the second" in lines
    assert lines.index("○ the first") > max(n for n, line in enumerate(lines) if line.startswith("  20  "))
