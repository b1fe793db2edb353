"""The documented example of a study's own worlds and kind: built as researchers build it, and gone through."""

import html
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from flask import Flask
from werkzeug.test import TestResponse

from tests.conftest import ROOT
from tests.unit.stimuli.study_folders import change, nobody, quietly
from tests.web.people import Visitor, hidden_nonce
from tests.web.reading import ask
from webapp.config import Config
from webapp.stimuli.build import build
from webapp.stimuli.catalogue import Catalogue
from webapp.views.services import services_of

EXAMPLE = ROOT / "docs/examples/own_world"
NAMES = {"west": "Sail west", "east": "Sail east", "load": "Load the cargo"}
INTO_A_HOLE = ("right", "down")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An instance with the example in it; agents are asked of nobody, since there is no key-door layout."""
    instance = tmp_path_factory.mktemp("example") / "instance"
    build(EXAMPLE, instance, quietly, nobody)
    return instance


@pytest.fixture
def instance(built: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built, tmp_path / "instance"))


@pytest.fixture
def app(instance: Path, start_app: Callable[[Config], Flask]) -> Flask:
    return start_app(Config(instance, study="own_world"))


@pytest.fixture
def catalogue(app: Flask) -> Catalogue:
    return services_of(app).bundles.current


class Walker:
    """Somebody who takes part in the example.

    Attributes:
        pages: What was shown, by the page's title.
        trials: The layout and kind of each trial, told by the database.
    """

    def __init__(self, app: Flask, catalogue: Catalogue, instance: Path) -> None:
        self.visitor = Visitor(app)
        self.catalogue = catalogue
        self.visitor.agree()
        (count,) = ask(instance, "SELECT max(id) FROM participants")[0]
        self.trials = ask(instance, "SELECT layout, kind FROM trials WHERE participant_id = ? ORDER BY number", count)
        self.seen: list[str] = []

    def walk(self, drive: Callable[[str], tuple[str, ...]]) -> None:
        """Go to the end; `drive` says what to do in the drives of a layout."""
        while (place := self.visitor.place()) != "/done":
            page = self.visitor.get(place)
            self.seen.append(html.unescape(page.text))
            if "data-drive-form" in page.text:
                self.drive(place, page, drive(self.layout_of(page.text)))
            else:
                assert self.visitor.post(place, filled_in(page)).status_code == 303
        self.seen.append(html.unescape(self.visitor.get("/done").text))

    def drive(self, place: str, page: TestResponse, actions: tuple[str, ...]) -> None:
        for step, action in enumerate(actions, start=1):
            form = {"nonce": hidden_nonce(page), "step": str(step), "action": action}
            assert self.visitor.post(f"{place}/action", form).status_code == 303
            self.seen.append(html.unescape(self.visitor.get(self.visitor.place()).text))

    def layout_of(self, page: str) -> str:
        position = re.search(r"Explanation (\d) of 3", page)
        return "bay" if position is None else str(self.trials[int(position[1]) - 1][0])

    def own_way(self, layout: str) -> tuple[str, ...]:
        return self.catalogue.world(layout).path_actions


def filled_in(page: TestResponse) -> dict[str, str]:
    """Choose the first of every group of answers."""
    form = {"nonce": hidden_nonce(page)}
    for group in re.findall(r"<input[^>]*type=\"radio\"[^>]*>", page.text):
        name, value = re.search(r'name="([^"]+)"', group), re.search(r'value="([^"]+)"', group)
        assert name is not None
        assert value is not None
        form.setdefault(name[1], value[1])
    return form


def test_every_kind_is_shown_in_every_world(app: Flask, catalogue: Catalogue, instance: Path) -> None:
    met: set[tuple[object, ...]] = set()
    for _ in range(6):
        walker = Walker(app, catalogue, instance)
        walker.walk(walker.own_way)
        met |= set(walker.trials)
    kinds, layouts = ("subgoals", "turns", "tailored_all"), ("strait", "sea", "lake")
    assert met == {(layout, kind) for layout in layouts for kind in kinds}
    ends = ask(instance, 'SELECT DISTINCT layout, "end", num_steps = optimum FROM drives ORDER BY layout')
    assert ends == [("bay", "reached", 1), ("lake", "reached", 1), ("sea", "reached", 1), ("strait", "reached", 1)]
    predicted = ask(instance, "SELECT DISTINCT predicted FROM predictions ORDER BY predicted")
    assert predicted == [("left",), ("west",)]
    assert ask(instance, "SELECT count(*) FROM participants WHERE completed_at IS NOT NULL") == [(6,)]


def test_a_drive_offers_the_worlds_own_actions(app: Flask, catalogue: Catalogue, instance: Path) -> None:
    walker = Walker(app, catalogue, instance)
    walker.walk(walker.own_way)
    practice = next(page for page in walker.seen if "data-drive-form" in page)
    buttons = re.findall(r'name="action" value="(\w+)" data-key="(\d)"><span>([^<]+)</span>', practice)
    assert buttons == [(name, str(number), label) for number, (name, label) in enumerate(NAMES.items(), start=1)]
    assert "This is where you start." in practice
    assert "The boat is on square 3 of 4; the cargo is on square 1." in practice
    assert "arrow up" not in practice
    assert any('role="status">Sail west.<span' in page for page in walker.seen)


def test_pictures_and_words_of_an_own_kind_are_those_of_its_steps(catalogue: Catalogue) -> None:
    from webapp.study.session import Trial  # noqa: PLC0415 - only here.

    world = catalogue.world("strait")
    actions = world.path_actions
    turning = [step for step in range(2, len(actions) + 1) if actions[step - 1] != actions[step - 2]]
    shown = catalogue.explanation(Trial("1", 1, 3, "strait", "turns", None), "en")
    expected = catalogue.strips_of("strait", turning, "en")
    assert shown == expected
    assert [strip.actions for strip in shown[1:]] == [("load the cargo",), ("sail east",)]
    assert shown[0].frames[0].alt == "The boat is on square 3 of 7; the cargo is on square 1."


def test_falling_into_a_hole_ends_a_drive_without_the_goal(app: Flask, catalogue: Catalogue, instance: Path) -> None:
    walker = Walker(app, catalogue, instance)
    walker.walk(lambda layout: INTO_A_HOLE if layout == "lake" else walker.own_way(layout))
    rows = ask(instance, "SELECT \"end\", num_steps, key_points != '' FROM drives WHERE layout = 'lake'")
    assert set(rows) == {("failed", 2, 1)}
    assert any("It ended before the goal." in page for page in walker.seen)


def test_a_web_worker_imports_neither_the_plug_ins_nor_what_they_need(instance: Path) -> None:
    program = f"""
import sys
from pathlib import Path
from webapp.app import create_app
from webapp.config import Config
app = create_app(Config(Path({str(instance)!r}), study="own_world"))
assert app.test_client().get("/").status_code == 200
print(sorted({{"own_world", "gymnasium", "numpy", "PIL"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_the_bundle_says_where_worlds_and_kinds_came_from(built: Path, catalogue: Catalogue) -> None:
    folder = built / "bundles" / catalogue.version
    listed = (folder / "sources/plug_ins.json").read_text(encoding="utf-8")
    assert '"worlds.lake":{"digest":"' in listed
    assert '"distribution":"gymnasium ' in listed
    assert '"kinds.turns"' in listed
    assert '"agent":"planner"' in (folder / "manifest.json").read_text(encoding="utf-8")
    assert (folder / "sources/study/own_world.py").read_bytes() == (EXAMPLE / "own_world.py").read_bytes()


def test_a_change_of_the_plug_in_makes_another_bundle(tmp_path: Path) -> None:
    study = Path(shutil.copytree(EXAMPLE, tmp_path / "own_world"))
    first = build(study, tmp_path / "instance", quietly, nobody)
    assert not build(study, tmp_path / "instance", quietly, nobody).is_new
    change(study / "own_world.py", "CARGO, HARBOUR = (205", "HARBOUR, CARGO = (205")
    second = build(study, tmp_path / "instance", quietly, nobody)
    assert second.is_new
    assert second.catalogue.version != first.catalogue.version
    assert first.catalogue.digests != second.catalogue.digests
