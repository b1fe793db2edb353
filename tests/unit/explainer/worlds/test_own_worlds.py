"""A researcher's own environment, named on the command line."""

import sys
from pathlib import Path

import pytest

from webapp.explainer.worlds.enumeration import enumerate_world
from webapp.explainer.worlds.gymnasium_worlds import world_of
from webapp.explainer.worlds.stepped_worlds import SteppedWorld

LADDER = """
from webapp.explainer.worlds.finite import Outcome


class Ladder:
    actions = ("climb", "wait")
    start = 0

    def __init__(self, rungs=3):
        if rungs < 1:
            raise ValueError(f"a ladder has rungs, not {rungs}")
        self.rungs = rungs

    def outcomes(self, state, action):
        return [Outcome(1.0, state + 1 - action, 0.0, action == 0 and state + 1 == self.rungs)]


ready = Ladder(2)
nothing = lambda: 7
half = type("Half", (), {"actions": ("a",), "start": 0})


def climb():
    import gymnasium

    class Steps(gymnasium.Env):
        observation_space, action_space = gymnasium.spaces.Discrete(4), gymnasium.spaces.Discrete(2)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.at = 0
            return 0, {}

        def step(self, action):
            self.at = min(self.at + action, 3)
            return self.at, float(self.at == 3), self.at == 3, False, {}

    return Steps()
"""


@pytest.fixture(autouse=True)
def in_a_folder_with_a_ladder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ladders").mkdir()
    (tmp_path / "ladders" / "__init__.py").touch()
    (tmp_path / "ladders" / "plain.py").write_text(LADDER, encoding="utf-8")
    (tmp_path / "broken_ladder.py").write_text("import no_such_thing_at_all\n", encoding="utf-8")
    (tmp_path / "crooked_ladder.py").write_text("1 / 0\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in ("ladders", "ladders.plain", "broken_ladder", "crooked_ladder"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_a_world_in_the_current_folder_is_found_and_given_its_options() -> None:
    assert enumerate_world(world_of("ladders.plain:Ladder")).states == (0, 1, 2, 3)
    assert enumerate_world(world_of("ladders.plain:Ladder", options={"rungs": 6})).num_states == 7
    assert enumerate_world(world_of("ladders.plain:Ladder", actions=["climb"])).actions == ("climb",)


def test_a_world_that_is_there_already_needs_no_call() -> None:
    assert enumerate_world(world_of("ladders.plain:ready")).num_states == 3


def test_a_gymnasium_environment_of_ones_own_is_stepped() -> None:
    world = world_of("ladders.plain:climb")
    assert isinstance(world, SteppedWorld)
    assert enumerate_world(world).states == (0, 1, 2, 3)


@pytest.mark.parametrize(
    ("name", "options", "problem"),
    [
        ("no_such_module:World", {}, r"there is no module 'no_such_module' in .* or among what is installed"),
        ("ladders.none:World", {}, "there is no module 'ladders.none'"),
        ("ladders.plain:Rope", {}, "the module 'ladders.plain' has no 'Rope'"),
        ("ladders.plain:", {}, "named module:callable, such as mypackage.machine:Machine, not 'ladders.plain:'"),
        ("lad ders:Ladder", {}, "named module:callable"),
        ("broken_ladder:Ladder", {}, "'broken_ladder' cannot be imported: No module named 'no_such_thing_at_all'"),
        ("crooked_ladder:Ladder", {}, "'crooked_ladder' cannot be imported: ZeroDivisionError: division by zero"),
        ("ladders.plain:Ladder", {"rungs": 0}, "Ladder cannot be made: ValueError: a ladder has rungs, not 0"),
        ("ladders.plain:Ladder", {"rope": 1}, "Ladder cannot be made: TypeError: .*'rope'"),
        ("ladders.plain:ready", {"rungs": 1}, "ready is not called, so it takes no options, and got rungs"),
        ("ladders.plain:nothing", {}, "nothing gave a int, which is neither .* it has no actions, start, outcomes"),
        ("ladders.plain:half", {}, "half gave a Half, which is neither .* it has no outcomes"),
    ],
)
def test_what_is_no_world_is_told(name: str, options: dict[str, object], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        world_of(name, options=options)
