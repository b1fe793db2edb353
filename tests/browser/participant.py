"""A participant at the browser: reads, clicks or types, and remembers what was shown and answered."""

import random
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal
from urllib.parse import urlsplit

from playwright.sync_api import Locator, Page

from tests.browser.site import Site

Hand = Literal["mouse", "touch", "keyboard"]
MAX_TABS = 80


@dataclass(frozen=True, slots=True)
class Answered:
    """One rating page as the participant saw it.

    Attributes:
        experiment: The experiment's id.
        position: The trial, from 1.
        strips: The digests of the pictures of each strip.
        actions: The words between them.
        alts: What stands for the pictures.
        ratings: By item.
        seconds: How long the page was open; no answer took longer.
    """

    experiment: str
    position: int
    strips: tuple[tuple[str, ...], ...]
    actions: tuple[tuple[str, ...], ...]
    alts: tuple[tuple[str, ...], ...]
    ratings: dict[str, int]
    seconds: float


@dataclass
class Participant:
    """Somebody with a browser window.

    Attributes:
        page: The window.
        site: The study.
        rng: Decides on the ratings.
        hand: What is used to move about.
        waits: Whether they look before they answer, as people do: an answer that is faster than the first paint has no
            response time. Nobody can wait for a clock where no scripts run.
    """

    page: Page
    site: Site
    rng: random.Random
    hand: Hand = "mouse"
    waits: bool = False
    answers: list[Answered] = field(default_factory=list)

    def complete(self) -> None:
        """Go all the way from the consent to the thanks."""
        self.agree()
        self.go_on("instructions.start")
        for experiment, position in self.trials():
            self.go_on("situation.continue")
            self.rate(experiment, position)
            self.send()
        self.page.wait_for_url("**/done")

    def trials(self) -> Iterator[tuple[str, int]]:
        """Yield experiment and position of each trial, in the order of the study file."""
        for experiment in self.site.catalogue.study.experiments:
            for position in range(1, len(experiment.layouts) + 1):
                yield experiment.id, position

    def agree(self) -> None:
        """Give consent."""
        self.page.goto("/")
        self.press(self.page.get_by_role("checkbox"), key="Space")
        self.go_on("welcome.start")
        self.page.wait_for_url("**/study/1")

    def go_on(self, key: str) -> None:
        """Press the button with this text."""
        self.check_width()
        before = urlsplit(self.page.url).path
        self.press(self.button(key))
        self.page.wait_for_url(lambda url: urlsplit(url).path != before)

    def rate(self, experiment: str, position: int) -> None:
        """Look at the explanation and answer every item."""
        began = time.monotonic()
        if self.waits:
            self.page.locator("form[data-clock=running]").wait_for()
        strips = self.page.locator("[data-explanation] .strip").all()
        ratings = {item: self.rng.randint(1, 5) for item in self.items()}
        for item, rating in ratings.items():
            self.answer(item, rating)
        self.answers.append(
            Answered(
                experiment,
                position,
                tuple(tuple(map(_digest, strip.locator("img").all())) for strip in strips),
                tuple(tuple(strip.locator(".strip__words").all_text_contents()) for strip in strips),
                tuple(tuple(str(img.get_attribute("alt")) for img in strip.locator("img").all()) for strip in strips),
                ratings,
                time.monotonic() - began + 5,
            )
        )

    def items(self) -> list[str]:
        """Return the ids of the items on this page."""
        names = [str(radio.get_attribute("name")) for radio in self.page.locator("fieldset input[value='1']").all()]
        return [name.removeprefix("rating-") for name in names]

    def answer(self, item: str, rating: int) -> None:
        """Choose a point of a scale."""
        if self.hand == "keyboard":
            self.press(self.page.locator(f"#rating-{item}-1"), key="Space")
            for _ in range(rating - 1):
                self.page.keyboard.press("ArrowRight")
        else:
            self.press(self.page.locator(f"label[for='rating-{item}-{rating}']"))
        assert self.page.locator(f"#rating-{item}-{rating}").is_checked()

    def answer_all(self, rating: int) -> None:
        """Choose the same point everywhere."""
        for item in self.items():
            self.answer(item, rating)

    def send(self) -> None:
        """Send the ratings."""
        self.go_on("explanation.send")

    def button(self, key: str) -> Locator:
        """Find a button by the key of its text."""
        return self.page.get_by_role("button", name=self.site.texts(key), exact=True)

    def press(self, target: Locator, key: str = "Enter") -> None:
        """Press something: click, tap, or go there with the tab key."""
        if self.hand == "mouse":
            target.click()
        elif self.hand == "touch":
            target.tap()
        else:
            self._tab_to(target)
            self.page.keyboard.press(key)

    def check_width(self) -> None:
        """Make sure that nobody has to scroll sideways."""
        too_wide = self.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert too_wide <= 0, f"{self.page.url} is {too_wide} pixels too wide"

    def _tab_to(self, target: Locator) -> None:
        for _ in range(MAX_TABS):
            if target.evaluate("element => element === document.activeElement"):
                return
            self.page.keyboard.press("Tab")
        raise AssertionError(f"the tab key does not lead to {target}")


def _digest(picture: Locator) -> str:
    found = re.search(r"([0-9a-f]+)\.png$", str(picture.get_attribute("src")))
    assert found
    return found.group(1)
