"""Explaining a map on demand; what is learned here is learned for real, on a map that takes seconds."""

from pathlib import Path

import numpy as np
import pytest

from tests.worlds import LAYOUTS, lay_out
from webapp.explainer.explanation import Explanation
from webapp.explainer.learning import TrainingSettings
from webapp.explainer.on_demand import NotLearned, Request, answer, as_json
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
        _, explanation = answer(layout, request, self.cache, report, settings=settings)
        return explanation

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
        ({"route": ("forward", "up")}, "'up' is not an action; use forward, left, right, pickup, toggle"),
    ],
)
def test_a_request_is_valid_from_birth(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Request(**wrong)  # type: ignore[arg-type]


def test_an_explanation_as_json_holds_plain_numbers_and_names() -> None:
    world, found = answer(SMALL, Request(route=("left",)), Path("unused"), lambda stage, done: None)  # noqa: ARG005
    written = as_json(world, found)
    assert written["states"][0] == [1, 1, 0, 0, 0]  # type: ignore[index]
    assert written["actions"] == [world.actions[action] for action in found.path.actions]
    assert written["explanation"] == {"step": found.key_points[0], **_named(written, found.key_points[0])}


def _named(written: object, step: int) -> dict[str, object]:
    assert isinstance(written, dict)
    return {"state": written["states"][step - 1], "action": written["actions"][step - 1]}
