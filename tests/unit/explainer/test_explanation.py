import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.explanation import EXPLANATION_KINDS, Explanation, ExplanationKind, Strip, explain, kind_strips
from webapp.explainer.importance import Importance, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import NeverArrives, Trajectory, follow, plan
from webapp.explainer.worlds.key_door import tabulate

PATH = Trajectory((10, 11, 12, 13, 14), (0, 1, 0, 2))


def explained(name: str, route: list[str] | None = None, from_step: int = 1) -> tuple[DeterministicMDP, Explanation]:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    actions = None if route is None else [mdp.actions.index(action) for action in route]
    assess = lambda path: exact_importance("return_probability", mdp, policy, path, 10)
    return mdp, explain(mdp, policy, assess, actions, from_step)


def test_nobody_asks_and_nothing_is_missing() -> None:
    _, found = explained("simulation")
    assert (found.route, found.key_points, found.explanation_step) == (None, (), None)
    assert found.subgoals == (7, 16, 20)


def test_the_explanation_is_the_earliest_key_point() -> None:
    _, found = explained("simulation", ["left", "left"])
    assert found.key_points == (7, 16, 20)
    assert found.explanation_step == 7


def test_subgoals_are_those_of_the_whole_path_wherever_the_question_is_asked() -> None:
    _, found = explained("simulation", ["toggle"], from_step=10)
    assert found.subgoals == (7, 16, 20)
    assert found.key_points == (16, 20)


def test_a_route_to_the_goal_leaves_nothing_to_explain() -> None:
    mdp, plain = explained("simulation")
    _, found = explained("simulation", [mdp.actions[action] for action in plain.path.actions])
    assert (found.key_points, found.explanation_step) == ((), None)


@pytest.mark.parametrize("step", [0, 21])
def test_a_question_at_a_step_that_is_not_there_is_refused_even_without_a_route(step: int) -> None:
    with pytest.raises(ValueError, match=f"no step {step}; the path has steps 1 to 20"):
        explained("simulation", from_step=step)


def test_a_policy_that_loops_is_not_explained() -> None:
    mdp = tabulate(lay_out("#######", "#>KD.G#", "#######"))
    spin = np.full(mdp.num_states, mdp.actions.index("left"), dtype=np.int32)
    nothing = lambda path: Importance(np.zeros(path.num_steps + 1), None)
    with pytest.raises(NeverArrives, match="it loops through KeyDoorState"):
        explain(mdp, spin, nothing)


def test_a_subgoal_explanation_of_the_simulation_has_the_papers_six_pictures() -> None:
    mdp, found = explained("simulation")
    strips = kind_strips("subgoals", found.path, found.subgoals)
    assert sum(len(strip.states) for strip in strips) == 6
    assert [len(strip.states) for strip in strips] == [1, 2, 2, 1]
    assert [[mdp.actions[action] for action in strip.actions] for strip in strips] == [[], ["pickup"], ["forward"], []]
    assert strips[0].states == (mdp.start,)
    assert mdp.goal[strips[-1].states[0]]


def test_the_full_sequence_shows_each_state_once() -> None:
    assert kind_strips("full", PATH) == (Strip(PATH.states, PATH.actions),)
    assert kind_strips("full", PATH, from_step=3) == (Strip((12, 13, 14), (0, 2)),)


def test_pairs_show_the_state_before_and_after_except_for_the_target() -> None:
    assert kind_strips("random", PATH, (1, 3)) == (Strip((10,)), Strip((10, 11), (0,)), Strip((12, 13), (0,)))
    assert kind_strips("random", PATH, (2, 4)) == (Strip((10,)), Strip((11, 12), (1,)), Strip((14,)))


def test_key_points_begin_with_the_state_in_which_the_question_is_asked() -> None:
    assert kind_strips("all_key_points", PATH, (3, 4), from_step=2) == (
        Strip((11,)),
        Strip((12, 13), (0,)),
        Strip((14,)),
    )


def test_the_first_key_point_stands_alone() -> None:
    assert kind_strips("first_key_point", PATH, (3, 4), from_step=2) == (Strip((11,)), Strip((12, 13), (0,)))
    assert kind_strips("first_key_point", PATH) == (Strip((10,)),)


@given(st.sampled_from(EXPLANATION_KINDS), st.integers(1, 4), st.data())
def test_every_kind_begins_with_the_current_state_and_shows_what_happened(
    kind: ExplanationKind, from_step: int, data: st.DataObject
) -> None:
    steps = [] if kind == "full" else sorted(data.draw(st.sets(st.integers(from_step, 4))))
    strips = kind_strips(kind, PATH, steps, from_step)
    assert strips[0].states[0] == PATH.states[from_step - 1]
    for strip in strips:
        for here, action, after in zip(strip.states, strip.actions, strip.states[1:], strict=False):
            assert PATH.states[PATH.pairs.index((here, action)) + 1] == after


@pytest.mark.parametrize("steps", [(2, 2), (3, 1), (0,), (5,)])
def test_steps_that_do_not_ascend_within_the_path_are_refused(steps: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="ascend from 1 to 4"):
        kind_strips("random", PATH, steps)


def test_steps_before_the_current_one_are_refused() -> None:
    with pytest.raises(ValueError, match="ascend from 3 to 4"):
        kind_strips("subgoals", PATH, (2, 4), from_step=3)


def test_the_full_sequence_takes_no_choice_of_steps() -> None:
    with pytest.raises(ValueError, match="shows every step"):
        kind_strips("full", PATH, (1,))


def test_a_strip_names_an_action_between_each_two_pictures() -> None:
    with pytest.raises(ValueError, match="1 actions stand between 2 pictures, not 3"):
        Strip((1, 2, 3), (0,))


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_path_is_the_policys(name: str) -> None:
    mdp, found = explained(name)
    assert found.path == follow(mdp, plan(mdp))
    assert found.threshold == pytest.approx(float(found.importance.values.mean()))
