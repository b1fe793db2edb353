"""Worlds of a study's own: what they may be, how they are drawn and named, and what is refused."""

import json
import re
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.unit.stimuli.study_folders import (
    ARMS,
    TAILORED,
    change,
    nobody,
    plan_and_build,
    quietly,
    set_languages,
    set_texts,
    small_study,
)
from webapp.stimuli.build import build
from webapp.stimuli.build_error import BuildError
from webapp.stimuli.own_worlds import MAX_STATES, ShownWorld, load_world
from webapp.stimuli.plug_ins import study_modules
from webapp.stimuli.sources import read_sources
from webapp.study.own_parts import OwnWorld
from webapp.study.problems import StudyError

LADDER = '''
"""A ladder whose top is the goal; below it is the ground, where it ends without."""

import numpy as np

from webapp.explainer import Outcome


class Ladder:
    actions = ("climb", "slide", "wait")

    def __init__(self, height=6):
        self.start, self.height = 1, height

    def outcomes(self, rung, action):
        after = rung + (1, -1, 0)[action]
        return [Outcome(1.0, after, 0.0, after == 0)]

    def is_goal(self, rung):
        return rung == self.height

    def picture(self, rung):
        drawn = np.full((self.height + 1, 1, 3), 200)
        drawn[self.height - rung] = 0
        return drawn
'''
EXAMPLE = ROOT / "docs/examples/own_world"
TEXTS = {"actions.climb": "climb", "actions.slide": "slide", "actions.wait": "wait"}


def ladder_study(folder: Path, module: str = LADDER, **settings: str) -> Path:
    """The small study with a ladder in the place of its layout, and what else of `[worlds]` a test asks for."""
    study = small_study(folder)
    lines = "".join(f"{key} = {value}\n" for key, value in {"use": '"ladder:Ladder"', **settings}.items())
    change(study / "study.toml", "[explanation]", f"[worlds.experiment1-a]\n{lines}\n[explanation]\nrandom_steps = 1")
    (study / "layouts/experiment1-a.txt").unlink()
    (study / "ladder.py").write_text(module, encoding="utf-8")
    set_languages(study, "en")
    set_texts(study, TEXTS)
    return study


def with_member(code: str) -> str:
    """The ladder's module with another member of its class."""
    return LADDER + "\n" + "\n".join(f"    {line}" if line else "" for line in code.splitlines()) + "\n"


def loaded(study: Path) -> ShownWorld:
    return read_sources(study).worlds["experiment1-a"]


def problem_of(study: Path) -> str:
    with pytest.raises(StudyError) as error:
        read_sources(study)
    (problem,) = error.value.problems
    return problem


class TestTheAgent:
    def test_it_takes_a_shortest_way(self, tmp_path: Path) -> None:
        built = build(ladder_study(tmp_path), tmp_path / "instance", quietly, nobody)
        assert built.catalogue.world("experiment1-a").path_actions == ("climb",) * 5
        assert built.reports[0].training == {"agent": "planner"}
        assert built.reports[0].max_difference == 0

    def test_it_is_the_worlds_own_if_that_brings_one(self, tmp_path: Path) -> None:
        module = with_member('def policy(self, rung):\n    return "climb" if rung % 2 else "slide"')
        with pytest.raises(BuildError, match="layout 'experiment1-a': the policy never reaches the goal"):
            plan_and_build(ladder_study(tmp_path, module), tmp_path / "instance")

    @pytest.mark.parametrize(
        ("returned", "told"),
        [
            ('"jump"', "policy gave 'jump' for 1; the actions are climb, slide, wait"),
            ("1 / 0", r"Ladder.policy raised ZeroDivisionError\('division by zero'\) for 1 \(ladder.py, line \d+\)"),
        ],
    )
    def test_a_policy_that_cannot_be_is_refused(self, returned: str, told: str, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, with_member(f"def policy(self, rung):\n    return {returned}"))
        assert re.search(rf"study\.toml, line \d+: worlds\.experiment1-a\.use: {told}$", problem_of(study))


class TestWords:
    def test_without_words_of_its_own_a_state_is_called_by_its_label(self, tmp_path: Path) -> None:
        assert loaded(ladder_study(tmp_path)).describe(0, "en") == "1"

    def test_an_environment_of_minigrid_is_described_by_its_parts(self, tmp_path: Path) -> None:
        use = OwnWorld(use="gymnasium:MiniGrid-Empty-5x5-v0", actions=("left", "right", "forward"))
        with study_modules(tmp_path):
            world = load_world("x", use, ["en"], tmp_path)
        assert world.describe(0, "en") == "at (1, 1) facing right"

    def test_a_label_with_named_parts_is_called_by_them(self, tmp_path: Path) -> None:
        module = LADDER.replace("class Ladder", "from collections import namedtuple\n\n\nclass Ladder")
        module = module.replace("self.start, self.height = 1", "self.start, self.height = self.Rung(1)")
        module = module.replace(
            "outcomes(self, rung, action):", "outcomes(self, label, action):\n        (rung,) = label"
        )
        module = module.replace("Outcome(1.0, after,", "Outcome(1.0, self.Rung(after),")
        module = module.replace("rung == self.height", "rung.number == self.height").replace(
            "- rung]", "- rung.number]"
        )
        module = module.replace("    actions =", "    Rung = namedtuple('Rung', 'number')\n    actions =")
        assert loaded(ladder_study(tmp_path, module)).describe(0, "en") == "number 1"

    def test_several_languages_need_words_in_each(self, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, with_member("def describe(self, rung):\n    return f'rung {rung}'"))
        assert loaded(study).describe(0, "en") == "rung 1"
        set_languages(study, "en", "ja")
        set_texts(study, TEXTS)
        text = (study / "texts/ja.toml").read_text(encoding="utf-8")
        added = "".join(f"{json.dumps(key)} = {json.dumps(words)}\n" for key, words in TEXTS.items() if key not in text)
        (study / "texts/ja.toml").write_text(added + text, encoding="utf-8")
        assert "Ladder.describe has words in one language, and the study has en, ja; give it" in problem_of(study)

    @pytest.mark.parametrize(("said", "told"), [("''", "describe gave '' for 1"), ("rung", "describe gave 1 for 1")])
    def test_words_that_are_none_are_refused(self, said: str, told: str, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, with_member(f"def describe(self, rung):\n    return {said}"))
        assert problem_of(study).endswith(f"worlds.experiment1-a.use: {told}; it should give words")

    def test_two_states_may_look_alike_and_be_described_differently(self, tmp_path: Path) -> None:
        module = LADDER.replace("drawn[self.height - rung] = 0", "")
        catalogue = plan_and_build(ladder_study(tmp_path, module), tmp_path / "instance").catalogue
        views = [catalogue.view("experiment1-a", state, "en") for state in range(7)]
        assert len({view.digest for view in views}) == 1
        assert {view.alt for view in views} == {"0", "1", "2", "3", "4", "5", "6"}

    def test_the_names_of_actions_are_the_studys_own(self, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, LADDER.replace('"climb"', '"forward"'))
        set_texts(study, {"actions.wait": None, "actions.forward": None})
        with pytest.raises(StudyError) as error:
            read_sources(study)
        told = [problem.partition("texts/en.toml")[2] for problem in error.value.problems]
        assert [key for problem in told for key in re.findall(r"actions\.\w+", problem)[:1]] == [
            "actions.forward",
            "actions.wait",
        ]
        assert all("is missing" in problem for problem in told)


class TestPictures:
    def test_a_gymnasium_environment_draws_the_state_to_which_it_was_led(self, tmp_path: Path) -> None:
        lake = OwnWorld(use="gymnasium:FrozenLake-v1", options={"is_slippery": False})
        with study_modules(tmp_path):
            world = load_world("lake", lake, ["en"], tmp_path)
        pictures, again = world.pictures(), world.pictures()
        assert pictures == again
        alive = [state for state in range(16) if "hole" not in world.describe(state, "en")]
        assert len({pictures[state] for state in alive}) == len(alive) == 12

    def test_a_world_without_pictures_is_refused(self, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, LADDER.replace("def picture", "def painting"))
        assert "Ladder cannot be drawn: give it picture(state), or the render_mode 'rgb_array'" in problem_of(study)

    @pytest.mark.parametrize(
        ("drawn", "told"),
        [
            ("3", r"the picture of 1: a int of shape \(\) is no picture"),
            ("1 / 0", r"Ladder.picture raised ZeroDivisionError\('division by zero'\) for 1"),
        ],
    )
    def test_a_picture_that_is_none_is_refused(self, drawn: str, told: str, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, LADDER.replace("return drawn", f"return {drawn}"))
        assert re.search(rf"worlds\.experiment1-a\.use: {told}", problem_of(study))

    def test_a_later_picture_that_is_none_stops_the_build(self, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, LADDER.replace("return drawn", "return drawn if rung < 4 else None"))
        with pytest.raises(BuildError, match="layout 'experiment1-a': the picture of 4: a NoneType of shape"):
            plan_and_build(study, tmp_path / "instance")


class TestRefusals:
    @pytest.mark.parametrize(
        ("before", "after", "told"),
        [
            ("[Outcome(1.0", "[Outcome(0.5, rung), Outcome(0.5", "in ladder:Ladder chance decides where actions lead"),
            ("height=6", "height=6000", f"ladder:Ladder has more than {MAX_STATES} states, and each is drawn"),
            ('"slide"', '"slide down quickly"', "an action is called 'slide down quickly'; use up to 16 printable"),
            ('"slide"', '"give_up"', "an action is called 'give_up'; use up to 16 printable characters, and not"),
            ("(1, -1, 0)", "(0, -1, 0)", "is_goal holds for none of the ends in reach"),
            ("height=6", "height", "ladder:Ladder cannot be made: TypeError"),
            ("import numpy as np", "import nunpy", "the module 'ladder' cannot be imported: No module named 'nunpy'"),
            ("actions =", "deeds =", "gave a Ladder, which is neither a Gymnasium environment nor a finite world"),
        ],
    )
    def test_a_world_that_cannot_be_shown_is_told_with_its_line(
        self, before: str, after: str, told: str, tmp_path: Path
    ) -> None:
        assert LADDER.count(before) == 1
        problem = problem_of(ladder_study(tmp_path, LADDER.replace(before, after)))
        assert re.search(rf"study\.toml, line \d+: worlds\.experiment1-a\.use: .*{told}", problem), problem

    @pytest.mark.parametrize("code", ["reset", "step", "render"])
    def test_an_environment_that_fails_is_told_with_its_line(self, code: str, tmp_path: Path) -> None:
        module = (EXAMPLE / "own_world.py").read_text(encoding="utf-8")
        start = module.index(f"    def {code}(")
        place = module.index('"""', module.index('"""', start) + 3) + 3
        (tmp_path / "failing.py").write_text(f"{module[:place]}\n        1 / 0{module[place:]}", encoding="utf-8")
        study = ladder_study(tmp_path, use='"failing:Ferry"')
        (tmp_path / "failing.py").rename(study / "failing.py")
        assert re.search(
            r"worlds\.experiment1-a\.use: .*ZeroDivisionError.*\(failing.py, line \d+\)$", problem_of(study)
        )

    @pytest.mark.parametrize(
        ("use", "told"),
        [
            ("gymnasium:FrozenLake-v1", "in gymnasium:FrozenLake-v1 chance decides where actions lead"),
            ("gymnasium:FrozenLak-v1", "there is no environment 'FrozenLak-v1'; did you mean FrozenLake-v1"),
            ("gymnasium:CartPole-v1", "has continuous observations"),
            ("nowhere", "there is no entry point 'nowhere' of the group 'xar.worlds'; there are: none"),
        ],
    )
    def test_a_name_that_leads_to_no_world_is_told(self, use: str, told: str, tmp_path: Path) -> None:
        assert told in problem_of(ladder_study(tmp_path, use=f'"{use}"'))

    def test_options_and_actions_are_those_of_the_study_file(self, tmp_path: Path) -> None:
        study = ladder_study(tmp_path, options="{ height = 3 }", actions='["wait", "climb"]')
        world = loaded(study)
        assert world.table.actions == ("wait", "climb")
        assert world.table.num_states == 3
        change(study / "study.toml", '"wait", "climb"', '"jump"')
        assert problem_of(study).endswith("'jump' is no action of this world; it has climb, slide, wait")

    def test_a_layout_beside_the_world_is_one_too_many(self, tmp_path: Path) -> None:
        study = ladder_study(tmp_path)
        (study / "layouts/experiment1-a.txt").write_text("#####\n", encoding="utf-8")
        assert "worlds.experiment1-a: there is a layouts/experiment1-a.txt too; keep one" in problem_of(study)


def test_every_kind_that_needs_no_questioner_works_in_an_own_world(tmp_path: Path) -> None:
    kinds = ["full", "subgoals", "random", *ARMS, *TAILORED]
    study = ladder_study(tmp_path, options="{ height = 12 }")
    more = f'kinds = {json.dumps(kinds)}\ndrive = {{}}\nprobe = {{ states = "path", num_questions = 3 }}'
    change(study / "study.toml", 'kinds = ["random"]', more)
    change(study / "study.toml", "[explanation]\n", '[debriefing]\ndiscloses = ["placebic"]\n\n[explanation]\n')
    change(study / "study.toml", 'id = "general"', 'id = "general"\nwithout_explanation = true')
    change(study / "study.toml", ', "landmarks"', "")  # A ladder has none.
    built = plan_and_build(study, tmp_path / "instance")
    assert built.reports[0].pictures["1"].keys() == set(kinds) - {"landmarks"}
    assert {probe.action for probe in built.catalogue.probes("1", "experiment1-a")} == {"climb"}


def test_key_door_layouts_and_own_worlds_stand_in_one_study(tmp_path: Path) -> None:
    study = ladder_study(tmp_path)
    shipped = ROOT / "webapp/studies/sakai2021/layouts/experiment1-b.txt"
    (study / "layouts/experiment1-b.txt").write_bytes(shipped.read_bytes())
    for before in ('layouts = ["experiment1-a"]\nfacts', 'layouts = ["experiment1-a"]\nkinds'):
        change(study / "study.toml", before, before.replace('-a"]', '-a", "experiment1-b"]'))
    built = plan_and_build(study, tmp_path / "instance")
    catalogue = built.catalogue
    assert [report.training for report in built.reports] == [{"agent": "planner"}, {}]
    assert catalogue.world("experiment1-b").actions == ("forward", "left", "right", "pickup", "toggle")
    ladder, key_door = catalogue.world("experiment1-a"), catalogue.world("experiment1-b")
    assert catalogue.action_name(ladder.path_actions[0], "en") == "climb"
    frames = {catalogue.view(world.layout, state, "en").digest for world in (ladder, key_door) for state in range(7)}
    assert frames <= set(catalogue.digests)
