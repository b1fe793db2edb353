"""Somebody goes through a whole study in the Firefox that people have, on a screen as wide as a phone's."""

import json
import random
import runpy
from dataclasses import dataclass, field

import pytest

from tests.browser.firefox import Firefox, open_firefox
from tests.browser.site import Row, Site, serve
from tests.conftest import ROOT
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build
from webapp.storage.exports import FileName
from webapp.study.session import DRIVEN

STUDY = "understanding"
# The arrows by WebDriver's code points.
KEYS = {"forward": "\ue013", "left": "\ue012", "right": "\ue014", "pickup": "p", "toggle": "o"}

RADIOS = "Array.from(document.querySelectorAll('form [type=radio]'), (radio) => [radio.name, radio.id, radio.value])"
OVERFLOW = "document.documentElement.scrollWidth - window.innerWidth"
STEPS_LEFT = "document.querySelector('[data-steps-left]').textContent"

FILES: tuple[FileName, ...] = (
    "participants.csv",
    "ratings.csv",
    "drives.csv",
    "probes.csv",
    "answers.csv",
    "events.csv",
)


@dataclass
class Visitor:
    """Somebody with a Firefox.

    Attributes:
        firefox: The window.
        site: The study.
        rng: Decides on the answers.
        seen: The kinds of the pages that were answered, in order.
        too_wide: The pages on which one has to scroll sideways, and by how much.
        ratings: The items and what was chosen, in order.
        drives: The actions of each drive, in order.
    """

    firefox: Firefox
    site: Site
    rng: random.Random = field(default_factory=lambda: random.Random(8))
    seen: list[str] = field(default_factory=list)
    too_wide: dict[str, int] = field(default_factory=dict)
    ratings: list[tuple[str, str]] = field(default_factory=list)
    drives: list[str] = field(default_factory=list)

    def complete(self) -> None:
        """Go from the consent to the thanks."""
        self.firefox.open(f"{self.site.address}/")
        self.look()
        self.firefox.click("label[for=age-group-adult]")
        self.firefox.click("label[for=agree]")
        self.send("form.consent button[type=submit]")
        while "/study/" in self.address:
            self.firefox.wait_until("document.querySelector('form[data-clock=running]')")
            self.answer_page(self.look())
        self.look()

    @property
    def address(self) -> str:
        """Where the window is."""
        return str(self.firefox.evaluate("location.href"))

    def look(self) -> str:
        """Return the kind of the page in front, and note if it is too wide."""
        kind = str(self.firefox.evaluate("document.body.dataset.page"))
        overflow = self.firefox.evaluate(OVERFLOW)
        if overflow > 0:
            self.too_wide[self.address] = overflow
        return kind

    def answer_page(self, kind: str) -> None:
        """Answer the page in front and go on."""
        self.seen.append(kind)
        if kind == "practice":
            self.drive_with_keys()
        elif kind in DRIVEN:
            self.drive_with_buttons()
        else:
            self.fill_in(kind)
            self.send("form.page-form .actions button[type=submit]")

    def fill_in(self, kind: str) -> None:
        """Choose one of the answers to each question, the right one in the quiz."""
        by_name: dict[str, list[tuple[str, str]]] = {}
        for name, element, value in self.firefox.evaluate(RADIOS):
            by_name.setdefault(name, []).append((element, value))
        for name, options in by_name.items():
            element, value = options[self.right_answer(name)] if kind == "quiz" else self.rng.choice(options)
            self.firefox.click(f"label[for='{element}']")
            if kind == "rating":
                self.ratings.append((name.removeprefix("rating-"), value))
        if self.firefox.evaluate("document.querySelectorAll('.question__input').length"):
            self.firefox.click(".question__input")
            self.firefox.press("3", "3")

    def right_answer(self, name: str) -> int:
        """Return the place of a quiz question's right answer, from 0."""
        quiz = self.site.catalogue.study.quiz
        assert quiz is not None
        question = next(question for question in quiz.questions if name.endswith(f"-{question.id}"))
        return question.choices.index(question.answer)

    def drive_with_keys(self) -> None:
        """Go the agent's way through the practice world."""
        practice = self.site.catalogue.study.practice
        assert practice is not None
        *actions, last = self.site.catalogue.world(practice.layout).path_actions
        self.firefox.click("[data-view]")
        for action in actions:
            before = self.firefox.evaluate(STEPS_LEFT)
            self.firefox.press(KEYS[action])
            self.firefox.wait_until(f"{STEPS_LEFT} !== {json.dumps(before)}")
        before = self.address
        self.firefox.press(KEYS[last])
        self.wait_for_another_page(before)
        self.drives.append(" ".join([*actions, last]))

    def drive_with_buttons(self) -> None:
        """Do two actions and give up."""
        for action in ("left", "forward"):
            before = self.firefox.evaluate(STEPS_LEFT)
            self.firefox.click(f"button[value={action}]")
            self.firefox.wait_until(f"{STEPS_LEFT} !== {json.dumps(before)}")
        self.send("button[value=give_up]")
        self.drives.append("left forward")

    def send(self, button: str) -> None:
        """Press a button that leads to another page."""
        before = self.address
        self.firefox.click(button)
        self.wait_for_another_page(before)

    def wait_for_another_page(self, before: str) -> None:
        self.firefox.wait_until(f"location.href !== {json.dumps(before)} && document.readyState === 'complete'")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What somebody did, and what is on file and in the console afterwards."""

    visitor: Visitor
    address: str
    files: dict[str, list[Row]]


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    program = runpy.run_path(str(ROOT / ".ci/install.py"))["find_firefox"]()
    assert program is not None, "no Firefox was found; `make test` installs one or says how"
    folder = tmp_path_factory.mktemp("firefox")
    build(ROOT / "webapp/studies" / STUDY, folder / "built", progress=lambda *_: None, agents=planner_agents)
    for name in ("instance", "profile"):
        (folder / name).mkdir()
    with (
        serve(folder / "built", folder / "instance", STUDY) as site,
        open_firefox(program, folder / "profile") as firefox,
    ):
        visitor = Visitor(firefox, site)
        try:
            visitor.complete()
        except BaseException:
            (ROOT / "test-results").mkdir(exist_ok=True)
            firefox.save_picture(ROOT / "test-results/firefox.png")
            raise
        return Outcome(visitor, visitor.address, {name: site.export(name) for name in FILES})


def test_the_study_can_be_done_from_beginning_to_end(outcome: Outcome) -> None:
    seen = outcome.visitor.seen
    assert seen[:4] == ["background", "instructions", "practice", "quiz"]
    assert [seen.count(kind) for kind in ("situation", "rating", "probe", "drive")] == [3, 3, 3, 3]
    assert outcome.address.endswith("/done")
    (participant,) = outcome.files["participants.csv"]
    assert participant["completed_at"]


def test_nobody_has_to_scroll_sideways(outcome: Outcome) -> None:
    assert outcome.visitor.too_wide == {}


def test_the_files_hold_exactly_what_was_done(outcome: Outcome) -> None:
    ratings = [(row["item"], row["rating"]) for row in outcome.files["ratings.csv"]]
    checks = [(row["question"], row["answer"]) for row in outcome.files["answers.csv"] if row["purpose"] == "attention"]
    assert sorted(ratings + checks) == sorted(outcome.visitor.ratings)
    assert sorted(row["actions"] for row in outcome.files["drives.csv"]) == sorted(outcome.visitor.drives)
    assert len(outcome.files["probes.csv"]) == 6
    quiz = [row for row in outcome.files["answers.csv"] if row["purpose"] == "quiz"]
    assert [row["is_correct"] for row in quiz] == ["true"] * 3


def test_times_are_measured(outcome: Outcome) -> None:
    assert all(0 < int(row["response_time_ms"]) < 60_000 for row in outcome.files["ratings.csv"])
    events = {row["event"] for row in outcome.files["events.csv"]}
    assert {"painted", "pictures_ready", "changed", "visible"} <= events
    assert "picture_failed" not in events


def test_nothing_is_written_to_the_console(outcome: Outcome) -> None:
    assert outcome.visitor.firefox.complaints == []
