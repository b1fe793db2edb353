"""What a study file may say of kinds and worlds of its own, told without importing any."""

import json
import re

import pytest

from tests.conftest import ROOT
from webapp.study.problems import StudyError
from webapp.study.protocol import Study, parse_study

FOLDER = ROOT / "docs/examples/own_world"
TEXT = (FOLDER / "study.toml").read_text(encoding="utf-8")
LINES = TEXT.splitlines()


def problem_of(before: str, after: str) -> str:
    assert TEXT.count(before) == 1, before
    with pytest.raises(StudyError) as error:
        parse_study(TEXT.replace(before, after))
    (problem,) = error.value.problems
    return problem


def test_own_kinds_and_worlds_are_read_without_importing_them() -> None:
    study = parse_study(TEXT.replace("own_world:", "there_is_no_such_module:"))
    assert study.kinds["turns"].use == "there_is_no_such_module:turns"
    assert study.worlds["sea"].options == {"length": 9}
    assert Study.model_validate_json(json.dumps(study.model_dump(mode="json"))) == study


@pytest.mark.parametrize(
    ("before", "after", "line", "message"),
    [
        (
            '"turns", ',
            '"tunrs", ',
            "kinds = [",
            r"experiments\[1\]\.kinds\[2\]: is 'tunrs'; .*or declare \[kinds\.tunrs\]",
        ),
        (
            "[kinds.turns]",
            "[kinds.full]\nuse = 'a:b'\n[kinds.turns]",
            None,
            "kinds.full: is the name of a built-in kind",
        ),
        ("[kinds.turns]", f"[kinds.{'k' * 33}]\nuse = 'a:b'\n[kinds.turns]", None, "use up to 32 characters"),
        ('"own_world:turns"', '"own_world:"', "own_world:turns", 'kinds.turns.use: is .*; use "module:name", or'),
        ('"own_world:turns"', '"own world"', "own_world:turns", 'kinds.turns.use: is .*; use "module:name", or'),
        ('use = "own_world:turns"', "", "[kinds.turns]", "kinds.turns.use: is missing"),
        ('"gymnasium:FrozenLake-v1"', '"gymnasium:"', "FrozenLake", "worlds.lake.use: is 'gymnasium:'; name an env"),
        (
            '"gymnasium:FrozenLake-v1"',
            '"a:b:c"',
            "FrozenLake",
            'worlds.lake.use: is \'a:b:c\'; use "module:name", "gym',
        ),
        (
            "[worlds.sea]",
            "[worlds.pond]\nuse = 'a:b'\n[worlds.sea]",
            None,
            "worlds.pond: is none of the study's layouts",
        ),
        ("[practice]", "[ask]\n[practice]", None, r"ask: needs key-door layouts, and 'bay' is one of \[worlds\]"),
        ("[practice]", "[learning.seeds]\nsea = 3\n[practice]", None, "learning.seeds.sea: .* not trained; remove it"),
    ],
)
def test_a_declaration_that_cannot_be_is_refused_with_its_line(
    before: str, after: str, line: str | None, message: str
) -> None:
    problem = problem_of(before, after)
    assert re.search(message, problem), problem
    if line is not None:
        (number,) = (place for place, text in enumerate(LINES, start=1) if line in text)
        assert problem.startswith(f"study.toml, line {number}: ")


def test_a_world_of_ones_own_has_no_questioner() -> None:
    question = '\n[experiments.question]\nquestioner = "door_open"\n'
    video = TEXT.replace('situation = "current_view"', 'situation = "video"') + question
    with pytest.raises(StudyError) as error:
        parse_study(video)
    assert len(error.value.problems) == 3
    for number, (problem, layout) in enumerate(zip(error.value.problems, ("strait", "sea", "lake"), strict=True), 1):
        told = f"experiments[1].layouts[{number}]: is '{layout}', one of [worlds], and the questioner of a 'video'"
        assert told in problem
