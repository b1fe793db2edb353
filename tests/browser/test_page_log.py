"""What a page shows while its pictures are loaded, and what it writes down: events, and how pictures are looked at."""

import time
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.axe import assert_accessible
from tests.browser.small_site import SmallSite, items, serve_small, strip
from tests.browser.windows import DESKTOP, PHONE, OpenContext

EXPLAINED = "{{ explanation(strips) }}{{ FORM }}"
STRIPS = (strip("a", "b", "c"), strip("d", "e"))
LIMIT_MS = 10_000

SHIFTS = """window.shifts = 0;
new PerformanceObserver((list) => list.getEntries().forEach((entry) => (window.shifts += entry.value)))
    .observe({ type: "layout-shift", buffered: true });"""


@pytest.fixture(scope="module")
def site() -> Iterator[SmallSite]:
    with serve_small() as site:
        yield site


@pytest.fixture
def page(site: SmallSite, open_context: OpenContext) -> Iterator[Page]:
    """A window before any page, on a site that shows an explanation of five pictures and logs behaviour."""
    site.renew()
    site.show(EXPLAINED, strips=STRIPS, items=items("long", "clear"), behaviour=True)
    page = open_context(expected=("503", "ERR_FAILED"), **DESKTOP).new_page()
    page.add_init_script(SHIFTS)
    yield page
    site.gate.set()
    page.close()


def begin(page: Page) -> None:
    page.goto("/")
    page.locator("[data-clock=running]").wait_for()


def send(page: Page, site: SmallSite) -> None:
    page.get_by_role("button", name="Send").click()
    page.wait_for_url("**/next")
    assert site.sent


def pictures(page: Page) -> Locator:
    return page.locator("img.picture")


def test_pictures_are_held_back_until_all_are_there_and_nothing_moves(page: Page, site: SmallSite) -> None:
    site.gate.clear()
    page.goto("/", wait_until="domcontentloaded")
    expect(page.get_by_text("Loading pictures: 0 of 5")).to_be_visible()
    expect(pictures(page).first).to_be_hidden()
    page.locator("#rating-clear-2").check()
    assert page.locator("form").get_attribute("data-clock") is None
    site.gate.set()
    page.locator("[data-clock=running]").wait_for()
    expect(pictures(page)).to_have_count(5)
    assert all(picture.is_visible() for picture in pictures(page).all())
    expect(page.locator(".loading")).to_have_count(0)
    page.locator("#rating-long-2").check()
    assert page.evaluate("shifts") == 0
    send(page, site)
    assert site.sent[0].fields["time-clear"] == ""
    assert int(site.sent[0].fields["time-long"]) > 0
    events = site.sent[0].events
    assert [event[0] for event in events[:4]] == ["changed", "pictures_ready", "painted", "changed"]
    assert events[0][3] == 0
    assert int(str(events[1][2])) >= 300


def test_the_page_is_there_when_the_scripts_do_not_come(page: Page) -> None:
    page.route("**/delivery.js", lambda route: route.abort())
    page.goto("/")
    expect(pictures(page).first).to_be_visible()
    expect(page.get_by_role("button", name="Send")).to_be_enabled()


def test_a_picture_that_fails_twice_is_shown_all_the_same(page: Page, site: SmallSite) -> None:
    site.pictures["b.png"] = 2
    begin(page)
    assert all(picture.is_visible() for picture in pictures(page).all())
    assert page.evaluate("[...document.images].every((picture) => picture.naturalWidth > 0)")
    send(page, site)
    assert site.sent[0].named("picture_failed") == []


def test_words_stand_where_a_picture_does_not_come_and_the_person_is_told(page: Page, site: SmallSite) -> None:
    site.pictures |= {"b.png": 9, "d.png": 9}
    begin(page)
    words = page.locator(".picture--words")
    assert words.all_text_contents() == ["The agent sees b.", "The agent sees d."]
    first = words.first.bounding_box()
    beside = pictures(page).first.bounding_box()
    assert first is not None
    assert beside is not None
    assert (first["width"], first["height"]) == (beside["width"], beside["height"])
    assert [words.first.is_visible(), pictures(page).nth(1).is_visible()] == [True, False]
    expect(page.locator("[data-explanation] [role=status]")).to_have_text("loading.failed")
    assert_accessible(page, "pictures that do not come")
    send(page, site)
    assert sorted(site.sent[0].named("picture_failed")) == [
        ["picture_failed", "2", "error"],
        ["picture_failed", "4", "error"],
    ]
    assert site.sent[0].named("pictures_ready") == []


def test_pictures_are_held_back_for_ten_seconds_at_most_and_shown_later_if_they_come(
    page: Page, site: SmallSite
) -> None:
    site.gate.clear()
    page.clock.install()
    page.goto("/", wait_until="domcontentloaded")
    page.clock.run_for(LIMIT_MS - 1000)
    assert page.locator(".picture--words").count() == 0
    page.clock.run_for(1500)
    page.locator("[data-clock=running]").wait_for()
    expect(page.locator(".picture--words")).to_have_count(5)
    site.gate.set()
    expect(page.locator(".picture--words")).to_have_count(0)
    expect(page.locator(".picture-notice")).to_have_count(0)
    assert all(picture.is_visible() for picture in pictures(page).all())
    send(page, site)
    assert site.sent[0].named("picture_failed")[0] == ["picture_failed", "1", "late"]
    assert len(site.sent[0].named("pictures_ready")) == 1


def test_the_log_tells_of_changes_and_of_the_window_and_outlives_a_reload(page: Page, site: SmallSite) -> None:
    begin(page)
    page.locator("#rating-long-4").check()
    for kind in ("blur", "blur", "focus", "focus"):
        page.evaluate("kind => dispatchEvent(new Event(kind))", kind)
    page.reload()
    begin(page)
    page.locator("#rating-long-2").check()
    send(page, site)
    names = ("painted", "changed", "focus_lost", "focus_regained")
    logged = [event for event in site.sent[0].named(*names) if event[0] != "painted"]
    assert logged == [
        ["changed", "long", "4"],
        ["focus_lost", "", ""],
        ["focus_regained", "", ""],
        ["changed", "long", "2"],
    ]
    times = [int(str(event[3])) for event in site.sent[0].events]
    assert times == sorted(times)
    assert all(isinstance(event[3], int) for event in site.sent[0].events)


def test_a_full_log_still_holds_the_sums(page: Page, site: SmallSite) -> None:
    begin(page)
    page.evaluate("""() => { for (let i = 0; i < 300; i += 1) {
        dispatchEvent(new Event("blur"));
        dispatchEvent(new Event("focus"));
    } }""")
    send(page, site)
    assert len(site.sent[0].events) == 400
    assert sorted(str(event[1]) for event in site.sent[0].named("visible")) == ["1", "2", "3", "4", "5"]


def attended(site: SmallSite, hand: str) -> dict[str, int]:
    """Milliseconds by picture."""
    sums: dict[str, int] = {}
    for _, number, value in site.sent[0].named("attended"):
        milliseconds, used = str(value).split()
        if used == hand:
            sums[str(number)] = sums.get(str(number), 0) + int(milliseconds)
    return sums


def test_looking_with_the_pointer_is_measured(page: Page, site: SmallSite) -> None:
    begin(page)
    began = time.monotonic()
    pictures(page).nth(1).hover()
    page.wait_for_timeout(400)
    page.evaluate("dispatchEvent(new Event('blur'))")  # Somebody looks elsewhere, the mouse stays.
    page.wait_for_timeout(400)
    page.evaluate("dispatchEvent(new Event('focus'))")
    pictures(page).nth(2).dispatch_event("pointerenter")  # On the way elsewhere.
    pictures(page).nth(2).dispatch_event("pointerleave")
    page.get_by_role("heading").hover()
    milliseconds = 1000 * (time.monotonic() - began)
    send(page, site)
    assert attended(site, "pointer").keys() == {"2"}
    assert 350 <= attended(site, "pointer")["2"] <= milliseconds - 350
    visible = {str(number): int(str(value)) for _, number, value in site.sent[0].named("visible")}
    assert visible.keys() == {"1", "2", "3", "4", "5"}
    assert all(milliseconds >= 350 for milliseconds in visible.values())


def test_looking_with_the_keyboard_is_measured_alike(page: Page, site: SmallSite) -> None:
    begin(page)
    assert [picture.get_attribute("tabindex") for picture in pictures(page).all()] == ["0", "-1", "-1", "0", "-1"]
    while not pictures(page).first.evaluate("picture => picture === document.activeElement"):
        page.keyboard.press("Tab")
    page.keyboard.press("ArrowRight")
    page.wait_for_timeout(300)
    page.keyboard.press("Tab")
    expect(pictures(page).nth(3)).to_be_focused()
    page.keyboard.press("End")
    expect(pictures(page).nth(4)).to_be_focused()
    page.keyboard.press("Shift+Tab")
    expect(pictures(page).nth(1)).to_be_focused()
    assert_accessible(page, "an explanation that is followed")
    send(page, site)
    assert {"2", "4", "5"} <= attended(site, "keyboard").keys()
    assert attended(site, "keyboard")["2"] >= 300
    assert attended(site, "pointer") == {}


def test_looking_with_a_finger_is_measured(site: SmallSite, open_context: OpenContext) -> None:
    site.renew()
    site.show(EXPLAINED, strips=STRIPS, items=items("long"), behaviour=True)
    page = open_context(**PHONE).new_page()
    begin(page)
    pictures(page).nth(2).tap()
    page.get_by_role("button", name="Send").tap()
    page.wait_for_url("**/next")
    assert attended(site, "touch").keys() == {"3"}
    page.close()


def test_where_the_study_does_not_say_so_nobody_is_watched(page: Page, site: SmallSite) -> None:
    site.show(EXPLAINED, strips=STRIPS, items=items("long"))
    begin(page)
    pictures(page).nth(1).hover()
    page.locator(".twin summary").click()
    page.wait_for_timeout(200)
    assert page.locator("[tabindex='0']").count() == 0
    send(page, site)
    assert {str(event[0]) for event in site.sent[0].events} == {"pictures_ready", "painted"}


def test_replays_steps_back_and_opened_texts_are_logged(page: Page, site: SmallSite) -> None:
    site.show("{{ player(video) }}{{ FORM }}", video=strip("a", "b"), behaviour=True, timed=False)
    begin(page)
    assert page.evaluate("shifts") == 0
    page.get_by_role("button", name="player.forward").click()
    page.get_by_role("button", name="player.back").click()
    page.get_by_role("button", name="player.forward").click()
    page.get_by_role("button", name="player.replay").click()
    summary = page.locator(".twin summary")
    summary.click()
    expect(page.locator(".twin li")).to_have_count(2)
    summary.click()
    assert_accessible(page, "a video that is followed")
    send(page, site)
    names = ("replayed", "stepped_back", "texts_opened", "texts_closed")
    assert site.sent[0].named(*names) == [
        ["stepped_back", "1", ""], ["replayed", "", ""], ["texts_opened", "1", ""], ["texts_closed", "1", ""]
    ]  # fmt: skip
