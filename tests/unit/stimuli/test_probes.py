"""What participants are asked to predict, against plans made from every state."""

from functools import cache
from typing import Literal

import numpy as np
import pytest

from tests.worlds import LAYOUTS
from webapp.explainer.mdp import DeterministicMDP, Policy
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.worlds.key_door import FORWARD, LEFT, tabulate
from webapp.stimuli.agents import BuildError
from webapp.stimuli.probes import Prediction, predictions
from webapp.study.experiments import Probe
from webapp.study.protocol import Experiment, Item

Where = Literal["path", "elsewhere"]


@cache
def world_of(name: str) -> tuple[DeterministicMDP, Policy, Trajectory]:
    mdp = tabulate(LAYOUTS[name])
    policy = plan(mdp)
    return mdp, policy, follow(mdp, policy)


def experiment(num_questions: int, states: Where) -> Experiment:
    return Experiment(
        id="1",
        layouts=tuple(LAYOUTS),
        kinds=("full",),
        situation="current_view",
        probe=Probe(num_questions=num_questions, states=states),
        items=(Item(id="general"),),
    )


def ask(name: str, states: Where, num_questions: int = 4, from_step: int = 1, seed: int = 1) -> tuple[Prediction, ...]:
    return predictions(seed, experiment(num_questions, states), name, *world_of(name), from_step)


@pytest.mark.parametrize("name", sorted(LAYOUTS))
@pytest.mark.parametrize("from_step", [1, 6])
def test_states_of_the_path_lie_between_the_current_one_and_the_goal(name: str, from_step: int) -> None:
    _, policy, path = world_of(name)
    between = path.states[from_step:-1]
    everything = ask(name, "path", min(len(between), 10), from_step)
    assert {each.state for each in everything} <= set(between)
    assert len({each.state for each in everything}) == len(everything)
    assert all(each.action == policy[each.state] for each in everything)


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_states_elsewhere_lie_off_the_path_and_the_agent_arrives_from_them(name: str) -> None:
    mdp, policy, path = world_of(name)
    for each in ask(name, "elsewhere", 10):
        assert each.state not in path.states
        assert not mdp.terminal[each.state]
        assert follow(mdp, policy, each.state).actions[0] == each.action


@pytest.mark.parametrize("name", sorted(LAYOUTS))
@pytest.mark.parametrize("states", ["path", "elsewhere"])
def test_as_good_are_the_actions_after_which_a_plan_is_as_short(name: str, states: Where) -> None:
    mdp, policy, _ = world_of(name)
    for each in ask(name, states, 10):
        lengths = {
            action: 1 + (0 if mdp.terminal[after] else follow(mdp, policy, int(after)).num_steps)
            for action, after in enumerate(mdp.next_state[each.state])
        }
        assert each.as_good == tuple(action for action, length in lengths.items() if length == min(lengths.values()))


def test_where_the_agent_dawdles_better_actions_are_as_good_and_idle_ones_are_not() -> None:
    """An agent that goes round to the left where the goal lies straight ahead."""
    next_state = np.array([[1, 2, 0], [1, 1, 1], [1, 3, 2], [1, 0, 3]], dtype=np.int32)
    ends = np.array([False, True, False, False])
    mdp = DeterministicMDP(("start", "goal", "side", "back"), ("ahead", "turn", "wait"), next_state, ends, ends, 0)
    policy = np.array([0, 0, 1, 0], dtype=np.int32)
    one = experiment(2, "elsewhere")
    found = {each.state: each for each in predictions(1, one, "round", mdp, policy, follow(mdp, policy), 1)}
    assert found[2] == Prediction(state=2, action=1, as_good=(0, 1))
    assert found[3] == Prediction(state=3, action=0, as_good=(0,))


def test_the_questions_depend_on_seed_experiment_and_layout_alone() -> None:
    assert ask("simulation", "elsewhere") == ask("simulation", "elsewhere")
    assert ask("simulation", "elsewhere") != ask("simulation", "elsewhere", seed=2)
    other = experiment(4, "elsewhere").model_copy(update={"id": "2"})
    assert predictions(1, other, "simulation", *world_of("simulation"), 1) != ask("simulation", "elsewhere")


def test_where_no_prediction_is_asked_for_there_is_no_question() -> None:
    silent = experiment(1, "path").model_copy(update={"probe": None})
    assert predictions(1, silent, "simulation", *world_of("simulation"), 1) == ()


def test_too_few_states_are_refused_with_layout_and_experiment() -> None:
    num_steps = world_of("experiment1-a")[2].num_steps
    assert len(ask("experiment1-a", "path", 2, num_steps - 2)) == 2
    with pytest.raises(
        BuildError,
        match=r"layout 'experiment1-a' in experiment '1': the probe asks about 2 states, and 1 lie on the agent's path",
    ):
        ask("experiment1-a", "path", 2, num_steps - 1)


def test_the_agents_action_is_as_good_as_itself() -> None:
    with pytest.raises(ValueError, match="must be among those as good"):
        Prediction(0, FORWARD, (LEFT,))
