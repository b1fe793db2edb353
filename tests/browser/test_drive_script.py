"""Steering the agent with scripts: every press counts once, and the person sees what the agent sees."""

import threading
from collections.abc import Iterator
from html import escape

import pytest
from playwright.sync_api import Page, ViewportSize, expect

from tests.browser.axe import assert_accessible
from tests.browser.small_site import Answer, Reply, Sent, SmallSite, markup, serve_small
from tests.browser.windows import DESKTOP, OpenContext

ACTIONS = {"left": "Turn left", "forward": "Forward", "right": "Turn right", "pickup": "Pick up", "toggle": "Open door"}
SMALL_PHONE: ViewportSize = {"width": 320, "height": 568}

DRIVE = """<section class="drive" aria-label="Drive" data-drive data-url="/action" data-preload="/pictures/view-2.png">
<div class="stage drive__stage">
<img class="picture" data-view src="/pictures/view-1.png" width="288" height="288" alt="View 1"></div>
<div class="drive__words"><p class="drive__message" data-drive-message role="status"></p>
<p class="drive__steps" data-steps-left>9 left</p></div>
<form class="drive__form" method="post" action="/action" data-drive-form data-nonce="n1" data-offline="You are offline."
 data-retrying="We try again."><input type="hidden" name="nonce" value="n1"><input type="hidden" name="step" value="1">
<input type="hidden" name="elapsed" value=""><div class="drive__pad">{{ buttons }}</div>
<button class="button button--quiet drive__give-up" name="action" value="give_up">Give up</button></form></section>
<p><a href="#main">Elsewhere</a></p>"""


@pytest.fixture(scope="module")
def site() -> Iterator[SmallSite]:
    with serve_small() as site:
        yield site


@pytest.fixture
def page(site: SmallSite, open_context: OpenContext) -> Iterator[Page]:
    """The page of a drive whose third action ends it."""
    site.renew()
    site.answer = step
    show(site, ACTIONS)
    page = open_context(expected=("503", "ERR_INTERNET_DISCONNECTED", "ERR_FAILED", "410"), **DESKTOP).new_page()
    page.goto("/")
    page.locator("[data-clock=running]").wait_for()
    yield page
    site.gate.set()
    page.close()


def show(site: SmallSite, words: dict[str, str]) -> None:
    kinds = dict.fromkeys(("pickup", "toggle"), "drive__button drive__button--half")
    buttons = [
        f'<button class="{kinds.get(action, "drive__button")}" name="action" value="{action}">{text}</button>'
        for action, text in words.items()
    ]
    site.show(DRIVE, buttons=markup("".join(buttons)))


def step(sent: Sent) -> Reply:
    return state_after(int(sent.fields["step"]), sent.fields["action"])


def state_after(number: int, action: str) -> Reply:
    if number == 3 or action == "give_up":
        return Reply()
    state = {
        "step": number + 1,
        "picture": f"/pictures/view-{number + 1}.png",
        "alt": f"View {number + 1}",
        "message": f"Done: {action}.",
        "steps_left": f"{9 - number} left",
        "preload": [f"/pictures/view-{number + 2}.png"],
        "next": None,
    }
    return Reply(content=state)


def press(page: Page, action: str) -> None:
    page.get_by_role("button", name=ACTIONS[action]).click()


def actions(site: SmallSite) -> list[tuple[str, str]]:
    return [(sent.fields["step"], sent.fields["action"]) for sent in site.sent]


def expect_view(page: Page, number: int) -> None:
    expect(page.get_by_role("img", name=f"View {number}", exact=True)).to_have_attribute(
        "src", f"/pictures/view-{number}.png"
    )


def test_each_press_shows_what_the_agent_sees_then(page: Page, site: SmallSite) -> None:
    press(page, "forward")
    expect_view(page, 2)
    expect(page.get_by_role("status").first).to_have_text("Done: forward. View 2")
    expect(page.locator("[data-steps-left]")).to_have_text("8 left")
    press(page, "pickup")
    expect_view(page, 3)
    assert actions(site) == [("1", "forward"), ("2", "pickup")]
    times = [int(sent.fields["elapsed"]) for sent in site.sent]
    assert 0 < times[0] < times[1]
    assert site.sent[0].by_script
    press(page, "left")
    page.wait_for_url("**/next")


def test_giving_up_is_an_action(page: Page, site: SmallSite) -> None:
    page.get_by_role("button", name="Give up").click()
    page.wait_for_url("**/next")
    assert actions(site) == [("1", "give_up")]


def press_twice_before_it_answers(page: Page, site: SmallSite, first: Answer) -> None:
    """Press left and right while the server takes its time over the first."""
    gate = threading.Event()

    def take(sent: Sent) -> Reply:
        gate.wait(10)
        return first(sent) if len(site.sent) == 1 else step(sent)

    site.answer = take
    with page.expect_request("**/action"):
        press(page, "left")
    press(page, "right")
    page.wait_for_timeout(150)
    assert actions(site) == [("1", "left")]
    gate.set()


def test_presses_wait_for_their_turn(page: Page, site: SmallSite) -> None:
    press_twice_before_it_answers(page, site, step)
    expect_view(page, 3)
    assert actions(site) == [("1", "left"), ("2", "right")]


def test_a_press_that_waited_is_dropped_when_the_one_before_gets_lost(page: Page, site: SmallSite) -> None:
    press_twice_before_it_answers(page, site, lambda _: Reply(503, "Busy"))
    expect_view(page, 2)
    page.wait_for_timeout(150)
    assert actions(site) == [("1", "left"), ("1", "left")]


def test_a_press_that_waited_is_dropped_when_the_drive_went_on_elsewhere(page: Page, site: SmallSite) -> None:
    press_twice_before_it_answers(page, site, lambda _: state_after(6, "left"))
    expect_view(page, 7)
    page.wait_for_timeout(150)
    assert actions(site) == [("1", "left")]


def test_a_view_replaces_the_last_only_when_it_can_be_painted(page: Page, site: SmallSite) -> None:
    press(page, "forward")
    expect_view(page, 2)
    page.wait_for_load_state("networkidle")
    site.gate.clear()
    site.answer = lambda _: Reply(content={**_content(state_after(2, "left")), "picture": "/pictures/slow.png"})
    press(page, "left")
    page.wait_for_timeout(150)
    expect_view(page, 2)
    expect(page.get_by_role("status").first).to_have_text("Done: forward. View 2")
    site.gate.set()
    expect(page.get_by_role("img", name="View 3")).to_have_attribute("src", "/pictures/slow.png")


def test_keys_act_while_the_focus_is_inside_and_once_however_long_they_are_held(page: Page, site: SmallSite) -> None:
    page.get_by_role("link", name="Elsewhere").focus()
    page.keyboard.press("ArrowUp")
    page.get_by_role("img", name="View 1").click()
    for key in ("ArrowUp", "o"):
        for _ in range(4):
            page.keyboard.down(key)
        page.keyboard.up(key)
    expect_view(page, 3)
    assert actions(site) == [("1", "forward"), ("2", "toggle")]
    assert page.evaluate("scrollY") == 0


def test_a_world_of_the_studys_own_says_which_key_presses_which_button(page: Page, site: SmallSite) -> None:
    own = {"1": "push left", "2": 'say "left"', "3": "left"}
    buttons = [
        f'<button class="drive__button" name="action" value="{name}" data-key="{key}">{name}</button>'
        for key, name in zip(own, map(escape, own.values()), strict=True)
    ]
    site.show(DRIVE, buttons=markup("".join(buttons)))
    page.goto("/")
    page.locator("[data-clock=running]").wait_for()
    assert [button.get_attribute("aria-keyshortcuts") for button in page.locator(".drive__button").all()] == list(own)
    page.get_by_role("img", name="View 1").click()
    for key in ("ArrowLeft", "p", "4", "2"):
        page.keyboard.press(key)
    expect_view(page, 2)
    page.keyboard.press("1")
    expect_view(page, 3)
    assert actions(site) == [("1", 'say "left"'), ("2", "push left")]


@pytest.mark.parametrize("key", ["Enter", "Space"])
def test_a_button_that_is_held_down_acts_once(page: Page, site: SmallSite, key: str) -> None:
    page.get_by_role("button", name="Turn left").focus()
    for _ in range(4):
        page.keyboard.down(key)
    page.keyboard.up(key)
    expect_view(page, 2)
    page.wait_for_timeout(100)
    assert actions(site) == [("1", "left")]


def test_keys_with_a_modifier_are_the_browsers(page: Page, site: SmallSite) -> None:
    page.get_by_role("img", name="View 1").click()
    page.keyboard.press("Control+p")
    page.keyboard.press("Shift+Tab")
    page.wait_for_timeout(100)
    assert site.sent == []


def test_a_step_that_got_lost_is_sent_again_with_its_number(page: Page, site: SmallSite) -> None:
    page.route("**/action", lambda route: (route.fetch(), route.abort()), times=1)
    press(page, "right")
    expect(page.locator(".sending-notice")).to_have_text("We try again.")
    press(page, "left")  # It hurries the lost one; nobody has seen yet what that does.
    expect_view(page, 2)
    expect(page.locator(".sending-notice")).to_be_empty()
    assert actions(site) == [("1", "right"), ("1", "right")]


def test_without_a_connection_a_step_waits_for_it(page: Page, site: SmallSite) -> None:
    page.context.set_offline(True)
    press(page, "forward")
    expect(page.locator(".sending-notice")).to_have_text("You are offline.")
    page.context.set_offline(False)
    expect_view(page, 2)
    assert actions(site) == [("1", "forward")]


def test_a_drive_that_went_on_in_another_window_is_shown_as_it_is_there(page: Page, site: SmallSite) -> None:
    site.answer = lambda sent: state_after(6, "left") if len(site.sent) == 1 else step(sent)
    press(page, "forward")
    expect_view(page, 7)
    press(page, "right")
    expect_view(page, 8)
    assert actions(site) == [("1", "forward"), ("7", "right")]


def test_what_the_server_refuses_loads_the_page_anew(page: Page, site: SmallSite) -> None:
    site.answer = lambda _: Reply(410, "Gone")
    with page.expect_navigation():
        press(page, "forward")
    assert len(site.sent) == 1


def test_it_fits_a_small_phone_and_its_targets_a_thumb(page: Page, site: SmallSite) -> None:
    page.set_viewport_size(SMALL_PHONE)
    show(
        site,
        dict(zip(ACTIONS, ("左を向く", "前に進む", "右を向く", "目の前の物を拾う", "ドアを開け閉めする"), strict=True)),
    )
    page.goto("/")
    page.locator("[data-clock=running]").wait_for()
    box = page.locator(".drive").bounding_box()
    assert box is not None
    assert box["height"] <= SMALL_PHONE["height"]
    assert page.evaluate("document.documentElement.scrollWidth") == SMALL_PHONE["width"]
    for button in page.get_by_role("button").all():
        size = button.bounding_box()
        assert size is not None
        assert min(size["width"], size["height"]) >= 48


def test_it_is_accessible(page: Page) -> None:
    press(page, "forward")
    expect_view(page, 2)
    expect(page.get_by_role("button", name="Forward")).to_have_attribute("aria-keyshortcuts", "ArrowUp")
    assert_accessible(page, "drive")


def _content(reply: Reply) -> dict[str, object]:
    assert isinstance(reply.content, dict)
    return reply.content
