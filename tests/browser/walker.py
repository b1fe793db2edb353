"""A participant who goes through whatever study there is, page by page, with scripts or without."""

import random
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from playwright.sync_api import Page, expect

from webapp.stimuli.catalogue import Catalogue

MAX_PAGES = 60
GIVE_UP = "give_up"
RADIOS = "Array.from(document.querySelectorAll('form input[type=radio]'), ({ name, id, value }) => [name, id, value])"
DRIVES = frozenset({"practice", "first_drive", "drive"})


@dataclass
class Walker:
    """Somebody with a browser window.

    Attributes:
        page: The window.
        catalogue: What the study shows.
        layout: The layout of every trial.
        rng: Decides on the answers.
        language: The language to read.
        from_step: The step of the agent's path at which the trials' drives start.
        first_drive: The actions of the drive before the explanation.
        seen: The kinds of the pages that were answered, in order.
        ratings: What was chosen, by item.
        predictions: The actions that were predicted, by the name of their field.
        shown: The digests of the explanation's pictures.
        waits: Whether they look before they answer, as people do: an answer that is faster than the first paint has no
            response time. Nobody can wait for a clock where no scripts run.
    """

    page: Page
    catalogue: Catalogue
    layout: str
    rng: random.Random
    language: str = "en"
    from_step: int = 1
    first_drive: tuple[str, ...] = ("left", GIVE_UP)
    seen: list[str] = field(default_factory=list)
    ratings: dict[str, int] = field(default_factory=dict)
    predictions: dict[str, str] = field(default_factory=dict)
    shown: list[str] = field(default_factory=list)
    waits: bool = False

    def agree(self, query: str = "") -> None:
        """Choose the language and give consent."""
        self.page.goto(f"/?lang={self.language}{query}")
        self.check_width()
        if self.page.locator("#age-group-adult").count():
            self.page.locator("label[for=age-group-adult]").click()
        self.page.locator("label[for=agree]").click()
        self.page.locator("form.consent button[type=submit]").click()
        self.page.wait_for_url("**/study/1")

    def complete(self) -> None:
        """Go from the consent to the thanks."""
        self.agree()
        for _ in range(MAX_PAGES):
            if "/study/" not in self.page.url:
                return
            self.answer_page()
        raise AssertionError("the study has no end")

    def go_to(self, kind: str) -> None:
        """Answer pages until one of this kind is in front."""
        for _ in range(MAX_PAGES):
            if self.kind() == kind:
                return
            self.answer_page()
        raise AssertionError(f"there is no page {kind!r}")

    def kind(self) -> str:
        """Return what stands on the page."""
        return str(self.page.locator("body").get_attribute("data-page"))

    def answer_page(self) -> None:
        """Answer the page in front and go on."""
        kind = self.kind()
        self.seen.append(kind)
        self.check_width()
        assert self.page.locator("html").get_attribute("lang") == self.language
        if kind in DRIVES:
            self.drive(*self._way(kind))
            return
        if kind == "rating":
            pictures = self.page.locator("[data-explanation] img").all()
            self.shown = [str(img.get_attribute("src")).split("/")[-1].removesuffix(".png") for img in pictures]
        if self.waits and self.page.locator("form[data-timed]").count():
            self.page.locator("form[data-clock=running]").wait_for()
        self.fill_in()
        self.send()

    def fill_in(self) -> None:
        """Answer every question of the page in front."""
        if self.kind() == "quiz":
            self.answer_quiz()
            return
        radios: dict[str, list[tuple[str, str]]] = {}
        for name, control, value in self.page.evaluate(RADIOS):
            radios.setdefault(name, []).append((control, value))
        for name, options in sorted(radios.items()):
            control, value = self.rng.choice(options)
            self.page.locator(f"label[for='{control}']").click()
            if name.startswith("rating-"):
                self.ratings[name.removeprefix("rating-")] = int(value)
            elif name.startswith("predict-"):
                self.predictions[name] = value
        for entry in self.page.locator(".question__input").all():
            entry.fill("33")

    def answer_quiz(self, *, right: bool = True) -> None:
        """Choose the right answer everywhere, or a wrong one."""
        quiz = self.catalogue.study.quiz
        assert quiz is not None
        for question in quiz.questions:
            place = question.choices.index(question.answer)
            number = place + 1 if right else (place + 1) % len(question.choices) + 1
            self.page.locator(f"label[for='answer-{question.id}-{number}']").click()

    def send(self) -> None:
        """Press the button and wait for another page."""
        before = urlsplit(self.page.url).path
        self.page.locator("form.page-form .actions button[type=submit]").click()
        self.page.wait_for_url(lambda url: urlsplit(url).path != before)

    def drive(self, *actions: str) -> None:
        """Press a button for each action; the last one ends the drive."""
        before = urlsplit(self.page.url).path
        for action in actions[:-1]:
            self.act(action)
        self.page.locator(f"button[value={actions[-1]}]").click()
        self.page.wait_for_url(lambda url: urlsplit(url).path != before)

    def act(self, action: str) -> None:
        """Press the button of an action that does not end the drive, and wait for what comes of it."""
        left = self.page.locator("[data-steps-left]")
        before = left.inner_text()
        self.page.locator(f"button[value={action}]").click()
        expect(left).not_to_have_text(before)

    def check_width(self) -> None:
        """Make sure that nobody has to scroll sideways."""
        sizes = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
        needed, there = self.page.evaluate(sizes)
        assert needed <= there, f"{self.page.url} needs {needed} pixels"

    def _way(self, kind: str) -> tuple[str, ...]:
        if kind == "first_drive":
            return self.first_drive
        if kind == "practice":
            return ("left", GIVE_UP)
        return self.catalogue.world(self.layout).path_actions[self.from_step - 1 :]
