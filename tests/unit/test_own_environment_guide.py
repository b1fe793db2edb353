"""The guide for researchers: its examples run, and print what it says."""

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.conftest import ROOT
from webapp.explainer.solvers import follow, plan
from webapp.explainer.stochastic import StochasticMDP
from webapp.explainer.stochastic_planning import most_probable, most_probable_path, plan_world
from webapp.explainer.worlds.enumeration import enumerate_world
from webapp.explainer.worlds.finite import FiniteWorld
from webapp.explainer.worlds.gymnasium_worlds import world_of

GUIDE = (ROOT / "docs/own-environment.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with the modules of the guide, as a researcher has it."""
    for program in PROGRAMS:
        if name := re.match(r'"""(\w+\.py):', program):
            (tmp_path / name[1]).write_text(program, encoding="utf-8")
            monkeypatch.delitem(sys.modules, name[1].removesuffix(".py"), raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])


@pytest.mark.usefixtures("machine")
def test_the_explanation_of_the_machine_is_the_one_in_the_guide(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(Path.cwd())
    (program,) = (each for each in PROGRAMS if not each.startswith('"""'))
    exec(program, ModuleType("tried").__dict__)  # noqa: S102 - that it runs is what is promised.
    (printed,) = re.findall(r"It prints\n\n```\n(.*?)```", GUIDE, re.DOTALL)
    assert capsys.readouterr().out == printed != ""


@pytest.mark.usefixtures("machine")
def test_the_machine_can_be_named_on_the_command_line() -> None:
    (name,) = re.findall(r"--env (\w+:\w+)", GUIDE)
    world = enumerate_world(world_of(name, options={"order": 3}))
    assert isinstance(world, StochasticMDP)
    path = most_probable_path(world, plan_world(world))
    assert [world.actions[action] for action in path.actions] == ["fetch", "repair", "produce", "produce", "produce"]
    assert all(world.states[int(state)][2] == 3 for state in world.goal.nonzero()[0])  # type: ignore[index]
    believed = most_probable(world)
    assert follow(believed, plan(believed)).num_steps == 5


def test_the_example_is_no_longer_than_promised() -> None:
    (program,) = (each for each in PROGRAMS if each.startswith('"""machine.py'))
    code = program.split("class Machine")[1]
    assert len([line for line in code.splitlines() if line.strip()]) <= 30


@pytest.mark.usefixtures("machine")
def test_a_continuous_environment_can_be_explained_in_bins() -> None:
    with pytest.raises(ValueError, match="MountainCar-v0 has continuous observations"):
        world_of("MountainCar-v0")
    world = world_of("hill:Hill", options={"bins": 16})
    assert isinstance(world, FiniteWorld)
    mdp = enumerate_world(world)
    assert isinstance(mdp, StochasticMDP)
    path = most_probable_path(mdp, plan_world(mdp))
    pushed = [mdp.actions[action] for action in path.actions]
    # The car is too weak to climb at once: it first has to swing back.
    assert "push left" in pushed
    assert "push right" in pushed
    assert min(mdp.states[state][0] for state in path.states[:-1]) < mdp.states[path.states[0]][0]  # type: ignore[index]
