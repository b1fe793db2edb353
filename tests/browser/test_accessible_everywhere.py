"""Every page that a study can have, in both languages: axe finds nothing, and a keyboard alone leads through it."""

import random
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.arms import STUDIES
from tests.browser.axe import assert_accessible
from tests.browser.site import Site, serve
from tests.browser.walker import DRIVES, GIVE_UP, Walker
from tests.browser.windows import DESKTOP, OpenContext
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build

STUDY = "understanding"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """The study in which everything is switched on."""
    folder = tmp_path_factory.mktemp("understanding")
    build(STUDIES / STUDY, folder / "built", progress=lambda *_: None, agents=planner_agents)
    (folder / "instance").mkdir()
    with serve(folder / "built", folder / "instance", STUDY) as site:
        yield site


@pytest.fixture
def page(open_context: OpenContext) -> Iterator[Page]:
    page = open_context(expected=("422", "400", "403", "404"), **DESKTOP).new_page()
    yield page
    page.close()


class OneOfEach(Walker):
    """Looks at the first page of each kind before answering it."""

    def answer_page(self) -> None:
        kind = self.kind()
        if kind not in self.seen:
            assert_accessible(self.page, f"{kind} in {self.language}")
            if kind == "quiz":
                self._fail_the_quiz()
            elif kind not in {*DRIVES, "instructions", "situation"}:
                self._leave_everything_open()
        super().answer_page()

    def _fail_the_quiz(self) -> None:
        self.answer_quiz(right=False)
        self.page.locator("form.page-form .actions button").click()
        expect(self.page.locator(".feedback")).to_have_count(3)
        assert_accessible(self.page, f"quiz with feedback in {self.language}")

    def _leave_everything_open(self) -> None:
        self.page.locator("form.page-form .actions button").click()
        expect(self.page.locator(".error-summary")).to_be_focused()
        assert_accessible(self.page, f"{self.kind()} with errors in {self.language}")

    def _way(self, kind: str) -> tuple[str, ...]:
        del kind
        return ("left", GIVE_UP)


@pytest.mark.parametrize("language", ["en", "ja"])
def test_axe_finds_nothing_on_any_page(page: Page, site: Site, language: str) -> None:
    walker = OneOfEach(page, site.catalogue, "", random.Random(2), language)
    page.goto(f"/?lang={language}")
    assert_accessible(page, f"welcome in {language}")
    page.locator("form.consent button").click()
    assert_accessible(page, f"welcome with errors in {language}")
    walker.complete()
    assert page.url.endswith("/done")
    for address in ("/done", "/declined", "/another-device", "/no-such-page", "/resume/" + "0" * 64):
        page.goto(address)
        assert_accessible(page, f"{address} in {language}")
    assert {"background", "practice", "quiz", "situation", "rating", "probe", "drive"} <= set(walker.seen)


def test_leaving_and_coming_back(page: Page, site: Site) -> None:
    walker = Walker(page, site.catalogue, "", random.Random(3))
    walker.agree()
    page.goto("/leave")
    page.get_by_role("link", name=site.texts("leave.another_device")).click()
    assert_accessible(page, "another device")
    link = page.locator(".completion-code code").inner_text()
    page.goto(link)
    assert_accessible(page, "resume")
    page.get_by_role("button", name=site.texts("resume.confirm")).click()
    page.wait_for_url("**/study/1")
    page.goto("/leave")
    page.get_by_role("button", name=site.texts("leave.confirm")).click()
    page.wait_for_url("**/left")
    assert_accessible(page, "left")


class Listener:
    """Somebody who hears roles and names and has nothing but a keyboard."""

    def __init__(self, page: Page, site: Site) -> None:
        self.page = page
        self.t = site.texts

    def press(self, role: str, name: str, key: str = "Enter") -> None:
        """Tab to a control of this role and name, and press a key."""
        target = self.page.get_by_role(role, name=name, exact=True).first  # type: ignore[arg-type]
        for _ in range(60):
            if target.evaluate("element => element === document.activeElement"):
                break
            self.page.keyboard.press("Tab")
        else:
            raise AssertionError(f"the tab key does not lead to the {role} {name!r}")
        self.page.keyboard.press(key)

    def choose(self, group: str, option: int) -> None:
        """Choose an option of a group of radios, by the group's name."""
        radios = self.page.get_by_role("group", name=group, exact=True).last.get_by_role("radio")
        self.page.evaluate("document.activeElement.blur()")
        radios.first.focus()
        self.page.keyboard.press("Space")
        for _ in range(option - 1):
            self.page.keyboard.press("ArrowDown")
        expect(radios.nth(option - 1)).to_be_checked()

    def heading(self, key: str) -> None:
        """Make sure that the page says what it is."""
        expect(self.page.get_by_role("heading", level=1)).to_have_text(self.t(key))


def test_a_screen_reader_finds_the_way_by_roles_and_names(page: Page, site: Site) -> None:
    listener, t = Listener(page, site), site.texts
    page.goto("/?lang=en")
    listener.heading("welcome.title")
    listener.choose(t("welcome.age_title"), 1)
    listener.press("checkbox", t("welcome.agree_guardian"), "Space")
    listener.press("button", t("welcome.start"))
    listener.heading("background.title")
    listener.press("checkbox", t("background.prefer_not_to_say"), "Space")
    for question in ("gender", "robots", "games"):
        listener.choose(t(f"background.{question}.question"), 2)
    listener.press("button", t("background.send"))
    listener.heading("instructions.title")
    listener.press("button", t("instructions.start"))
    listener.heading("drive.title_practice")
    status = page.get_by_role("region", name=t("drive.label")).get_by_role("status").first
    expect(status).to_contain_text(t("drive.start"))
    listener.press("button", t("drive.buttons.left"))
    expect(status).to_contain_text(t("drive.did.left"))
    view = str(page.locator("[data-view]").get_attribute("alt"))
    expect(status).to_contain_text(view)
    page.keyboard.press("ArrowUp")
    expect(status).to_contain_text(t("drive.did.forward"))
    listener.press("button", t("drive.skip"))
    listener.heading("quiz.title")
    quiz = site.catalogue.study.quiz
    assert quiz is not None
    for asked in quiz.questions:
        listener.choose(t(f"quiz.{asked.id}.question"), asked.choices.index(asked.answer) + 1)
    listener.press("button", t("quiz.send"))
    listener.heading("situation.title_current")
    listener.press("button", t("situation.continue"))
    page.wait_for_url("**/study/6")


def test_every_picture_has_its_words_twice(page: Page, site: Site) -> None:
    walker = Walker(page, site.catalogue, "", random.Random(4), first_drive=("left", GIVE_UP))
    walker.agree()
    page.locator("body").wait_for()
    looked_at = 0
    for _ in range(40):
        if "/study/" not in page.url:
            break
        pictures = page.locator("main img.picture:not([data-view])").all()
        alts = [str(picture.get_attribute("alt")) for picture in pictures]
        twins = " ".join(page.locator("details.twin").all_text_contents())
        for alt in alts:
            assert len(alt) > 10
            assert alt in twins
        looked_at += len(alts)
        if walker.kind() in DRIVES:
            walker.drive("left", GIVE_UP)
        else:
            walker.fill_in()
            walker.send()
    assert looked_at > 10


@pytest.fixture
def narrow(open_context: OpenContext) -> Iterator[Page]:
    """320 px wide, which is also 1280 px at 400 %."""
    page = open_context(viewport={"width": 320, "height": 568}, has_touch=True, is_mobile=True).new_page()
    yield page
    page.close()


@pytest.mark.parametrize("language", ["en", "ja"])
def test_nothing_is_too_wide_or_too_small_at_320_pixels(narrow: Page, site: Site, language: str) -> None:
    walker = Small(narrow, site.catalogue, "", random.Random(5), language)
    walker.complete()
    assert narrow.url.endswith("/done")


class Small(Walker):
    """Measures what is to be touched before each page is answered."""

    def answer_page(self) -> None:
        if self.kind() not in self.seen:
            self._measure()
        super().answer_page()

    def _measure(self) -> None:
        targets = "main button, main summary, main a.button, main label.choice, main label.rating__option, main select"
        for target in self.page.locator(targets).filter(visible=True).all():
            box = target.bounding_box()
            assert box is not None
            assert round(box["height"]) >= 44, f"{target.inner_text()!r} on {self.kind()} is {box['height']} px high"
            assert round(box["width"]) >= 44, f"{target.inner_text()!r} on {self.kind()} is {box['width']} px wide"

    def _way(self, kind: str) -> tuple[str, ...]:
        del kind
        return ("left", GIVE_UP)
