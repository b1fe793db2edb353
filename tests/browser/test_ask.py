"""The open page on which anybody asks the agent, with scripts and without, on a large screen and on a phone."""

from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlencode

import pytest
from playwright.sync_api import Page, ViewportSize, expect

from tests.browser.axe import assert_accessible
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, PHONE, OpenContext
from webapp.stimuli.world_table import WorldTable

LAYOUT = "experiment1-c"
SMALLEST: ViewportSize = {"width": 320, "height": 568}
MAX_BYTES, MAX_PICTURE_BYTES = 60_000, 150_000
TOUCH_TARGET = 44
SIZES = """() => [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")]
    .map((entry) => [entry.name, entry.decodedBodySize])"""
WINDOWS = {"desktop": DESKTOP, "phone": PHONE}

Open = Callable[..., Page]


@pytest.fixture
def open_page(open_context: OpenContext) -> Iterator[Open]:
    """Open windows in English unless asked otherwise; a wrong route is refused with 422."""
    opened: list[Page] = []

    def open_page(**options: Any) -> Page:  # noqa: ANN401
        context = open_context(expected=("422", "ERR_FAILED"), **{"locale": "en-GB", **DESKTOP, **options})
        opened.append(context.new_page())
        return opened[-1]

    yield open_page
    for page in opened:
        page.close()


@pytest.fixture
def world(site: Site) -> WorldTable:
    return site.catalogue.world(LAYOUT)


def address(**query: str) -> str:
    return f"/ask?{urlencode(query)}"


def press(page: Page, action: str) -> None:
    """Press a button of the route and wait until the page shows what it did."""
    before = page.locator(".route__step").count()
    page.locator(f"button[name=action][value={action}]").click()
    expect(page.locator(".route__step")).to_have_count(before - 1 if action == "undo" else before + 1)


def press_at_once(page: Page, *buttons: str) -> None:
    page.evaluate("all => all.forEach((one) => document.querySelector(`button${one}`).click())", buttons)


def is_too_wide(page: Page) -> bool:
    return bool(page.evaluate("document.documentElement.scrollWidth > document.documentElement.clientWidth"))


@pytest.mark.parametrize("window", sorted(WINDOWS))
@pytest.mark.parametrize("scripts", [True, False])
def test_a_visitor_takes_the_agents_way_and_shares_what_it_says(
    open_page: Open, site: Site, world: WorldTable, window: str, scripts: bool
) -> None:
    page = open_page(java_script_enabled=scripts, **WINDOWS[window])
    page.goto("/")
    page.get_by_role("link", name=site.texts("ask.link")).click()
    page.locator(f"a.world[href*={LAYOUT}]").click()
    for step, action in enumerate(world.path_actions, start=1):
        assert (
            page.locator("[data-view]").get_attribute("alt")
            == site.catalogue.view(LAYOUT, world.path_states[step - 1], "en").alt
        )
        press(page, action)
        assert not is_too_wide(page)
    expect(page.locator("[data-ask-message]")).to_have_text(site.texts("ask.at_goal"))
    page.get_by_role("button", name=site.texts("ask.send")).click()
    expect(page.locator(".verdict")).to_contain_text(site.texts.plural("ask.reached", world.num_steps))
    expect(page.locator("#answer")).to_be_in_viewport()
    sentences = site.catalogue.sentences(LAYOUT, "en")
    expect(page.locator(".moment__sentence")).to_have_text([sentences[step] for step in world.subgoals])
    assert not is_too_wide(page)
    other = open_page(java_script_enabled=False)
    other.goto(page.url)
    assert other.locator("#answer").inner_text() == page.locator("#answer").inner_text()
    assert page.context.cookies() == other.context.cookies() == []


def test_with_scripts_the_page_stays_and_so_does_the_focus(open_page: Open, site: Site) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT, route="left", ask="yes"))
    page.evaluate("window.stays = true")
    page.locator("details.ask__write summary").click()
    press(page, "right")
    expect(page.locator("button[value=right]")).to_be_focused()
    expect(page.locator(".verdict")).to_have_count(0)
    alt = page.locator("[data-view]").get_attribute("alt")
    expect(page.locator("[data-ask-status]")).to_have_text(f"{site.texts('drive.did.right')} {alt}")
    assert page.evaluate("window.stays")
    assert page.locator("#route").input_value() == "left right"
    assert page.locator("#route").is_visible()
    assert page.url.endswith(address(layout=LAYOUT, route="left right"))
    assert "route=left+right&" in str(page.locator("#languages a").last.get_attribute("href"))


def test_presses_that_come_faster_than_the_answers_all_count(open_page: Open) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT))
    pressed = ["left", "left", "right", "forward", "left", "toggle"]
    press_at_once(page, *(f"[value={action}]" for action in pressed))
    expect(page.locator(".route__step")).to_have_count(len(pressed))
    assert page.locator("#route").input_value() == " ".join(pressed)


def test_a_question_waits_for_the_presses_before_it(open_page: Open) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT))
    press_at_once(page, "[value=left]", "[value=right]", "[name=ask]")
    expect(page.locator(".verdict")).to_be_visible()
    assert page.url.partition("#")[0].endswith(address(layout=LAYOUT, route="left right", ask="yes"))


def test_keys_steer_where_the_buttons_are_and_write_where_one_writes(open_page: Open) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT))
    page.locator("button[value=right]").focus()
    for number, key in enumerate(("ArrowLeft", "ArrowUp", "ArrowRight", "p", "O"), start=1):
        page.keyboard.press(key)
        expect(page.locator(".route__step")).to_have_count(number)
    assert page.locator("#route").input_value() == "left forward right pickup toggle"
    page.locator("details.ask__write summary").click()
    page.locator("#route").fill("")
    page.locator("#route").press("p")
    page.locator("#route").press("ArrowLeft")
    assert page.locator("#route").input_value() == "p"
    expect(page.locator(".route__step")).to_have_count(5)


@pytest.mark.parametrize("scripts", [True, False])
def test_a_route_can_be_written_and_a_wrong_one_can_be_mended(open_page: Open, site: Site, scripts: bool) -> None:
    page = open_page(java_script_enabled=scripts)
    page.goto(address(layout=LAYOUT))
    page.locator("details.ask__write summary").click()
    page.locator("#route").fill("left, jump")
    page.locator("#from").select_option("4")
    page.get_by_role("button", name=site.texts("ask.send")).click()
    summary = page.locator(".error-summary")
    expect(summary).to_contain_text(site.texts("ask.errors.action", value="jump"))
    expect(summary).to_be_focused()
    expect(page.locator("#route")).to_have_value("left, jump")
    page.locator("#route").fill("left, f")
    page.get_by_role("button", name=site.texts("ask.go")).click()
    expect(page.locator(".route__step")).to_have_count(2)
    expect(page.locator("#from")).to_have_value("4")


def test_a_wrong_route_under_a_button_is_told_on_a_page_of_its_own(open_page: Open) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT))
    page.locator("details.ask__write summary").click()
    page.locator("#route").fill("jump")
    page.locator("button[value=left]").click()
    expect(page.locator(".error-summary")).to_be_focused()
    expect(page.locator("#route")).to_have_value("jump")


def test_a_press_that_gets_lost_is_made_up_for(open_page: Open) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT))
    page.route("**/ask?*action=*", lambda route: route.abort(), times=1)
    press(page, "left")
    assert page.url.endswith(address(layout=LAYOUT, route="left"))


@pytest.mark.parametrize("language", ["en", "ja"])
def test_axe_finds_nothing_and_nobody_scrolls_sideways(open_page: Open, world: WorldTable, language: str) -> None:
    page = open_page()
    way = " ".join(world.path_actions)
    shown = {
        "start": {},
        "a route": {"layout": LAYOUT, "route": "forward forward forward left"},
        "an answer to a route that does not arrive": {"layout": LAYOUT, "route": "toggle left", "ask": "yes"},
        "an answer to one that does": {"layout": LAYOUT, "route": f"{way} left", "ask": "yes"},
        "a later beginning": {"layout": LAYOUT, "from": "5"},
        "a wrong route": {"layout": LAYOUT, "route": "jump", "from": "99"},
        "a wrong layout": {"layout": "nowhere"},
        "a language that is not there": {"lang": "tlh"},
    }
    for name, query in shown.items():
        page.goto(address(**{"lang": language, **query}))
        page.evaluate("document.querySelectorAll('details').forEach((details) => (details.open = true))")
        assert_accessible(page, f"{name} in {language}")
        page.set_viewport_size(SMALLEST)
        assert not is_too_wide(page), f"{name} in {language}"


@pytest.mark.parametrize("language", ["en", "ja"])
def test_what_is_touched_is_large_enough_for_a_finger(open_page: Open, language: str) -> None:
    page = open_page(**PHONE)
    page.goto(address(layout=LAYOUT, route="left", ask="yes", lang=language))
    page.locator("details.ask__write summary").click()
    targets = page.locator("main :is(a, button, summary, select, textarea)").all()
    assert len(targets) > 15
    for target in targets:
        box = target.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= TOUCH_TARGET, target.inner_text()


def test_the_page_is_light(open_page: Open) -> None:
    page = open_page()
    page.goto(address(layout=LAYOUT, route="left", ask="yes"), wait_until="networkidle")
    sizes: list[tuple[str, int]] = page.evaluate(SIZES)
    pictures = sum(size for url, size in sizes if "/pictures/" in url)
    assert 0 < pictures < MAX_PICTURE_BYTES
    assert 0 < sum(size for _, size in sizes) - pictures < MAX_BYTES
