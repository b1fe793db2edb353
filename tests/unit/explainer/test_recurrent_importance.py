"""Importance by rollouts through a recurrent model, on models whose answers are known."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from tests.sampled import recurrent_importance
from tests.worlds import LAYOUTS
from webapp.explainer.importance import PROBABILITY_KINDS, ProbabilityKind, exact_importance
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.sampling import sample_recurrent
from webapp.explainer.solvers import Trajectory, follow, plan
from webapp.explainer.stop_rule import StopRule
from webapp.explainer.subgoals import importance_threshold
from webapp.explainer.worlds.key_door import tabulate


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


class TableModel:
    """A world model that has learned a table by heart, and counts its steps in its hidden state.

    From its `bewildered_after`-th step on it believes that nothing moves any more.
    """

    def __init__(self, mdp: DeterministicMDP, bewildered_after: int = 10_000) -> None:
        self._mdp, self._bewildered_after = mdp, bewildered_after
        self.num_actions = mdp.num_actions

    def initial(self, batch: int) -> torch.Tensor:
        return torch.zeros(batch, 1)

    def step(
        self, hidden: torch.Tensor, states: torch.Tensor, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        here = np.array([self._mdp.index[tuple(state)] for state in states.tolist()], dtype=np.int64)
        after = self._mdp.next_state[here, actions.numpy()]
        after = np.where(hidden[:, 0].numpy() < self._bewildered_after, after, here)
        labels = torch.tensor([self._mdp.states[state] for state in after.tolist()], dtype=torch.int64)
        return hidden + 1, labels.reshape(len(after), -1), torch.from_numpy(self._mdp.terminal[after])


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_a_model_that_knows_the_table_by_heart_gives_the_tables_importance(kind: ProbabilityKind) -> None:
    mdp = tabulate(LAYOUTS["experiment1-c"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    exact = exact_importance(kind, mdp, policy, path, 5).values
    sampled = recurrent_importance(kind, TableModel(mdp), mdp, policy, path, 5, 300, seed=0)
    assert np.all(np.abs(sampled.values - exact) <= 4 * np.sqrt(exact * (1 - exact) / 300) + 1e-12)
    assert sampled.standard_errors is not None
    expected = np.sqrt(sampled.values * (1 - sampled.values) / 300)
    np.testing.assert_allclose(sampled.standard_errors, expected, atol=1e-12)
    other = recurrent_importance(kind, TableModel(mdp), mdp, policy, path, 5, 300, seed=1)
    assert not np.array_equal(sampled.values, other.values)


def test_the_hidden_state_is_carried_from_the_random_phase_into_the_policy_phase() -> None:
    mdp = tabulate(LAYOUTS["experiment1-c"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    # Five random actions are still predicted, and then nothing moves: no walker returns, and none arrives.
    model = TableModel(mdp, bewildered_after=5)
    assert not recurrent_importance("return_probability", model, mdp, policy, path, 5, 20, seed=0).values.any()
    assert not recurrent_importance("ace", model, mdp, policy, path, 5, 20, seed=0).values.any()
    # One action more is enough for the last state but one to be returned to, now and then.
    model = TableModel(mdp, bewildered_after=6)
    assert recurrent_importance("return_probability", model, mdp, policy, path, 5, 200, seed=0).values.any()


def test_as_many_rollouts_as_fit_run_at_once_and_all_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    mdp = tabulate(LAYOUTS["experiment1-c"])
    policy = plan(mdp)
    path = follow(mdp, policy)
    monkeypatch.setattr("webapp.explainer.batched_rollouts.recurrent._MAX_WALKERS", 40)
    exact = exact_importance("ace", mdp, policy, path, 2).values
    sampled = recurrent_importance("ace", TableModel(mdp), mdp, policy, path, 2, 101, seed=0)
    assert np.all(np.abs(sampled.values - exact) <= 4 * np.sqrt(exact * (1 - exact) / 101) + 1e-12)
    assert all(round(float(value) * 101, 9).is_integer() for value in sampled.values)


@pytest.mark.parametrize("kind", PROBABILITY_KINDS)
def test_rollouts_through_a_model_stop_by_the_same_rule(kind: ProbabilityKind) -> None:
    mdp, policy, path = three_steps()
    found = sample_recurrent(kind, TableModel(mdp), mdp, policy, path, 2, StopRule(20_000, early=True), seed=0)
    assert (found.stopped, found.unsettled, found.num_truncated) == ("settled", (), 0)
    assert found.num_trials < 20_000
    exact = exact_importance(kind, mdp, policy, path, 2).values
    sampled = found.importance.values
    assert ((sampled > importance_threshold(sampled)) == (exact > importance_threshold(exact))).all()
    again = sample_recurrent(kind, TableModel(mdp), mdp, policy, path, 2, StopRule(20_000, early=True), seed=0)
    np.testing.assert_array_equal(again.importance.values, sampled)


def three_steps() -> tuple[DeterministicMDP, np.ndarray, Trajectory]:
    """A corridor with a side room beside its second cell, whose only way out leads through the first."""
    moves = np.array([[1, 0], [2, 3], [4, 1], [0, 3], [4, 4]], dtype=np.int32)
    end = np.array([False, False, False, False, True])
    mdp = DeterministicMDP(tuple((i,) for i in range(5)), ("on", "aside"), moves, end, end.copy(), 0)
    policy = plan(mdp)
    return mdp, policy, follow(mdp, policy)


def test_walkers_still_on_their_way_after_as_many_steps_as_states_are_reported_and_settle_nothing() -> None:
    mdp, policy, path = three_steps()
    model = TableModel(mdp, bewildered_after=2)
    found = sample_recurrent("ace", model, mdp, policy, path, 2, StopRule(50, early=True), seed=0)
    assert (found.stopped, found.num_trials) == ("budget", 50)
    # Each of three states has 50 walkers that are allowed all, of whom none moves on, and 50 of whom some stand stuck.
    assert 150 <= found.num_truncated <= 300
    assert found.unsettled == (1, 2, 3, 4)
    assert not found.importance.values.any()


def test_no_trials_are_refused() -> None:
    mdp = tabulate(LAYOUTS["experiment1-c"])
    policy = plan(mdp)
    with pytest.raises(ValueError, match="trials must be a whole number from 1 to 1,000,000, not 0"):
        recurrent_importance("ace", TableModel(mdp), mdp, policy, follow(mdp, policy), 2, 0, seed=0)
