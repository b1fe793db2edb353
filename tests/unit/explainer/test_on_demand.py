"""Explaining a map on demand; what is learned here is learned for real, on a map that takes seconds."""

from pathlib import Path

import numpy as np
import pytest

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.explanation import Explanation
from webapp.explainer.learning import TrainingSettings
from webapp.explainer.on_demand import answer, as_json
from webapp.explainer.questioner import Belief
from webapp.explainer.requests import Request
from webapp.explainer.subjects import EnvironmentSource, MapSource
from webapp.explainer.training_cache import NotLearned
from webapp.explainer.worlds.key_door import ACTIONS
from webapp.explainer.worlds.layout import Layout, LayoutError

SMALL = lay_out("######", "#>KD.#", "#..#G#", "######")
# That the losses have flattened as well would take minutes.
QUICK = TrainingSettings(max_relative_change=1.0)


class Asker:
    """Asks about maps, with networks kept in one folder."""

    def __init__(self, cache: Path) -> None:
        self.cache = cache
        self.reports: list[tuple[str, float]] = []

    def ask(self, request: Request, layout: Layout = SMALL, settings: TrainingSettings = QUICK) -> Explanation:
        self.reports.clear()
        report = lambda stage, done: self.reports.append((stage, done))
        return answer(MapSource(layout), request, self.cache, report, settings).explanation

    @property
    def kept(self) -> list[Path]:
        return sorted(self.cache.iterdir())


@pytest.fixture(scope="module")
def asker(tmp_path_factory: pytest.TempPathFactory) -> Asker:
    found = Asker(tmp_path_factory.mktemp("instance") / "explain-cache")
    found.ask(Request(world="learned", policy="dqn"))
    return found


def test_a_training_is_reported_and_kept_for_its_owner_alone(tmp_path: Path) -> None:
    asker = Asker(tmp_path / "cache")
    asker.ask(Request(policy="dqn", seed=1))
    stages, done = zip(*asker.reports, strict=True)
    assert set(stages) == {"training"}
    assert list(done) == sorted(done)
    assert done[-1] <= 1
    assert [path.suffix for path in asker.kept] == [".safetensors"]
    assert asker.cache.stat().st_mode & 0o077 == 0


def test_what_is_learned_is_learned_once_and_serves_every_question(asker: Asker) -> None:
    kept = asker.kept
    asker.ask(Request(world="learned", policy="dqn", importance="ace", route=("left",)))
    asker.ask(Request(world="exact", policy="dqn", random_steps=3))
    asker.ask(Request(world="learned", policy="planner", estimator="monte-carlo", num_trials=10))
    assert asker.reports == []
    assert asker.kept == kept
    assert len(kept) == 1


def test_nothing_is_learned_for_the_exact_world_and_the_planner(tmp_path: Path) -> None:
    asker = Asker(tmp_path / "cache")
    asker.ask(Request(estimator="monte-carlo", num_trials=10))
    assert asker.reports == []
    assert not asker.cache.exists()


def test_an_agent_that_learned_a_map_explains_it_as_the_exact_world_does(asker: Asker) -> None:
    for kind in ("return_probability", "ace"):
        learned = asker.ask(Request(world="learned", policy="dqn", importance=kind))
        exact = asker.ask(Request(world="exact", policy="dqn", importance=kind))
        planned = asker.ask(Request(world="exact", policy="planner", importance=kind))
        np.testing.assert_allclose(learned.importance.values, exact.importance.values, rtol=0, atol=1e-9)
        assert learned.path.num_steps == exact.path.num_steps == planned.path.num_steps


def test_a_learned_world_is_sampled_through_its_network(asker: Asker) -> None:
    request = Request(world="learned", policy="dqn", estimator="monte-carlo", random_steps=2, num_trials=400)
    sampled = asker.ask(request).importance
    table = asker.ask(Request(world="exact", policy="dqn", estimator="monte-carlo", random_steps=2, num_trials=400))
    exact = asker.ask(Request(world="exact", policy="dqn", random_steps=2)).importance.values
    assert sampled.standard_errors is not None
    assert np.all(np.abs(sampled.values - exact) <= 0.02 + 4 * np.sqrt(exact * (1 - exact) / 400))
    assert not np.array_equal(sampled.values, table.importance.values)


def test_what_was_not_learned_within_the_budget_is_not_explained(tmp_path: Path) -> None:
    hopeless = TrainingSettings(num_cycles=1, cycle_iterations=100, window_iterations=50, checkpoint_iterations=50)
    asker = Asker(tmp_path / "cache")
    with pytest.raises(NotLearned, match=r"the training failed: .*not optimal"):
        asker.ask(Request(policy="dqn"), LAYOUTS["simulation"], hopeless)
    assert not asker.cache.exists()


def test_a_goal_out_of_reach_is_refused_before_anything_is_learned(tmp_path: Path) -> None:
    asker = Asker(tmp_path / "cache")
    with pytest.raises(LayoutError, match="the goal cannot be reached"):
        asker.ask(Request(policy="dqn"), lay_out("######", "#>#KD#", "####G#", "######"))
    assert asker.reports == []


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"random_steps": -1}, "random_steps must be 0 or larger, not -1"),
        ({"num_trials": 0}, "num_trials must be 1 or larger, not 0"),
        ({"seed": -1}, "seed must be 0 or larger, not -1"),
        ({"from_step": 0}, "from_step must be 1 or larger, not 0"),
        ({"route": ()}, "at least one action"),
        ({"discount": 1.0}, "the discount must lie above 0 and below 1, not 1.0"),
        ({"discount": float("nan")}, "the discount must lie above 0 and below 1, not nan"),
        ({"stops_early": True}, "only sampling can stop early"),
        ({"importance": "reward_importance", "estimator": "monte-carlo"}, "reward_importance is not a probability"),
        ({"threshold": "top-k"}, "top-k needs it"),
        ({"num_subgoals": 2}, "a number of subgoals belongs to the threshold top-k"),
    ],
)
def test_a_request_is_valid_from_birth(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Request(**wrong)  # type: ignore[arg-type]


def test_an_explanation_as_json_holds_plain_numbers_and_names() -> None:
    request = Request(route=("left",))
    found = answer(MapSource(SMALL), request, Path("unused"), lambda stage, done: None)  # noqa: ARG005
    written, explanation = as_json(found, request), found.explanation
    assert written["states"][0] == [1, 1, 0, 0, 0]  # type: ignore[index]
    assert written["actions"] == [found.subject.world.actions[action] for action in explanation.path.actions]
    assert written["explanation"] == {"step": explanation.key_points[0], **_named(written, explanation.key_points[0])}


def _named(written: object, step: int) -> dict[str, object]:
    assert isinstance(written, dict)
    return {"state": written["states"][step - 1], "action": written["actions"][step - 1]}


def test_a_mistaken_world_is_rolled_out_in_the_learned_one_as_in_the_exact_one(asker: Asker) -> None:
    belief = Belief(lay_out("######", "#>KD.#", "#G.#.#", "######"))
    learned = asker.ask(Request(world="learned", belief=belief))
    exact = asker.ask(Request(belief=belief))
    assert asker.reports == []
    assert learned.route == exact.route == (ACTIONS.index("right"), ACTIONS.index("forward"))
    assert learned.key_points == exact.key_points == exact.subgoals != ()


def test_a_believed_map_of_another_size_is_refused_before_anything_is_learned(tmp_path: Path) -> None:
    asker = Asker(tmp_path / "cache")
    with pytest.raises(LayoutError, match="the believed map is 7 cells wide and 3 high, the real one 6 and 4"):
        asker.ask(Request(policy="dqn", belief=Belief(lay_out("#######", "#>KD.G#", "#######"))))
    assert asker.reports == []
    assert not asker.cache.exists()


def test_an_action_that_a_map_does_not_have_is_refused_before_anything_is_learned(tmp_path: Path) -> None:
    asker = Asker(tmp_path / "cache")
    with pytest.raises(ValueError, match="'up' is not an action; use forward, left, right, pickup, toggle"):
        asker.ask(Request(policy="dqn", route=("forward", "up")))
    assert asker.reports == []


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (Request(policy="dqn"), "are trained for key-door maps only, not for 'FrozenLake-v1'"),
        (Request(world="learned"), "are trained for key-door maps only, not for 'FrozenLake-v1'"),
        (Request(belief=Belief(SMALL)), "a believed map belongs to a map, and 'FrozenLake-v1' is none"),
    ],
)
def test_what_only_maps_have_is_refused_for_an_environment(tmp_path: Path, request_: Request, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        answer(EnvironmentSource("FrozenLake-v1"), request_, tmp_path, lambda stage, done: None)  # noqa: ARG005


def test_a_route_and_a_belief_together_are_refused() -> None:
    with pytest.raises(ValueError, match="a route and a believed map are two ways of asking"):
        Request(route=("left",), belief=Belief(SMALL))
