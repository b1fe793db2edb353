import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.mdps import mdps
from tests.worlds import LAYOUTS
from webapp.explainer import random_phases
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.random_phases import balls
from webapp.explainer.solvers import follow, plan, random_phase
from webapp.explainer.worlds.key_door import tabulate


@pytest.fixture(params=["one ball for all", "a ball for each two"])
def cutting(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut balls out of small worlds, too."""
    if request.param == "a ball for each two":
        monkeypatch.setattr(random_phases, "_SMALL_WORLD", 0)
        monkeypatch.setattr(random_phases, "_BLOCK", 2)


@pytest.mark.usefixtures("cutting")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mdps(), st.integers(0, 5), st.data())
def test_a_ball_holds_the_random_phase_of_each_of_its_starts(
    mdp: DeterministicMDP, num_steps: int, data: st.DataObject
) -> None:
    starts = data.draw(st.lists(st.integers(0, mdp.num_states - 1), max_size=5, unique=True))
    actions = data.draw(st.lists(st.integers(0, mdp.num_actions - 1), min_size=len(starts), max_size=len(starts)))
    forbidden = np.array(actions, dtype=np.int64)[:, None] == np.arange(mdp.num_actions)
    covered = []
    for ball in balls(mdp, starts, num_steps):
        assert [starts[column] for column in ball.columns] == ball.states[ball.starts].tolist()
        free, denied = ball.random_phase(num_steps), ball.random_phase(num_steps, forbidden[ball.columns])
        for column, number in enumerate(ball.columns):
            pair = (starts[number], actions[number])
            for found, expected in (
                (free, random_phase(mdp, starts[number], num_steps)),
                (denied, random_phase(mdp, starts[number], num_steps, forbidden=pair)),
            ):
                np.testing.assert_allclose(found[:, column], expected[ball.states], rtol=0, atol=1e-14)
                assert found[:, column].sum() == pytest.approx(1)
            covered.append(number)
    assert covered == list(range(len(starts)))


def test_all_actions_of_a_start_may_be_forbidden() -> None:
    table = np.array([[1, 2], [0, 2], [0, 1], [3, 3]], dtype=np.int32)
    end = np.array([False, False, False, True])
    mdp = DeterministicMDP(("a", "b", "c", "goal"), ("x", "y"), table, end, end.copy(), 0)
    (ball,) = balls(mdp, [0, 1], 2)
    # Who may not leave `a` stays there. From `b`, without x, all go to `c`, and on to `a` or back to `b`.
    found = ball.random_phase(2, np.array([[True, True], [True, False]]))
    assert found.T.tolist() == [[1, 0, 0, 0], [0.5, 0.5, 0, 0]]


def test_a_ball_is_no_larger_than_what_can_be_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(random_phases, "_SMALL_WORLD", 0)
    mdp = tabulate(LAYOUTS["simulation"])
    path = follow(mdp, plan(mdp))
    (ball,) = balls(mdp, path.states[:3], 4)
    within = np.zeros(mdp.num_states, dtype=np.bool_)
    for state in path.states[:3]:
        for num_steps in range(5):
            within |= random_phase(mdp, state, num_steps) > 0
    assert ball.states.tolist() == np.flatnonzero(within).tolist()
    assert len(ball.states) < mdp.num_states


def test_a_negative_radius_is_refused() -> None:
    mdp = tabulate(LAYOUTS["simulation"])
    with pytest.raises(ValueError, match="random actions must be 0 or larger, not -1"):
        next(balls(mdp, [], -1))
