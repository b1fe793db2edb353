"""The video of Experiment 2."""

import random
import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser.participant import Participant
from tests.browser.site import Site
from tests.browser.windows import DESKTOP, TIMEOUT_MS, OpenContext


def open_video(site: Site, open_context: OpenContext, **options: object) -> tuple[Participant, int]:
    """Go to the first page with a video; return who went there and how many pictures the video has."""
    participant = Participant(open_context(**DESKTOP, **options).new_page(), site, random.Random(4))
    participant.agree()
    participant.go_on("instructions.start")
    for experiment, position in participant.trials():
        if site.catalogue.study.experiment(experiment).situation == "video":
            break
        participant.go_on("situation.continue")
        participant.rate(experiment, position)
        participant.send()
    return participant, participant.page.locator(".player img").count()


def shown(page: Page) -> list[int]:
    """Return which pictures of the video can be seen, from 1."""
    steps = page.locator(".player .strip__step").all()
    return [number for number, step in enumerate(steps, start=1) if step.is_visible()]


@pytest.fixture(scope="module")
def video(site: Site, open_context: OpenContext) -> tuple[Participant, int]:
    return open_video(site, open_context, reduced_motion="reduce")


def test_it_waits_for_people_who_prefer_reduced_motion(video: tuple[Participant, int]) -> None:
    page = video[0].page
    page.reload()
    expect(video[0].button("player.play")).to_be_visible()
    page.wait_for_timeout(2500)
    assert shown(page) == [1]


def test_it_steps_forward_and_back_and_ends_at_the_last_picture(video: tuple[Participant, int]) -> None:
    participant, count = video
    participant.page.reload()
    for number in range(2, count + 1):
        participant.button("player.forward").click()
        assert shown(participant.page) == [number]
    expect(participant.button("player.replay")).to_be_visible()
    participant.button("player.back").click()
    assert shown(participant.page) == [count - 1]


def test_it_plays_to_the_end_at_the_speed_that_was_chosen(video: tuple[Participant, int], site: Site) -> None:
    participant, count = video
    participant.page.reload()
    participant.page.get_by_label(site.texts("player.speed")).select_option(label=site.texts("player.fast"))
    participant.button("player.play").click()
    expect(participant.button("player.replay")).to_be_visible(timeout=count * 600 + 3000)
    assert shown(participant.page) == [count]


def test_pausing_keeps_the_picture(video: tuple[Participant, int]) -> None:
    participant, _ = video
    participant.page.reload()
    participant.button("player.play").click()
    participant.button("player.pause").click()
    before = shown(participant.page)
    participant.page.wait_for_timeout(2500)
    assert shown(participant.page) == before


def test_it_plays_by_itself_for_everybody_else(video: tuple[Participant, int]) -> None:
    page = video[0].page
    page.emulate_media(reduced_motion="no-preference")
    page.reload()
    expect(page.locator(".player .strip__step").first).to_be_hidden(timeout=TIMEOUT_MS)  # The next one has its place.
    page.emulate_media(reduced_motion="reduce")


def test_without_scripts_all_its_pictures_stand_in_a_list(site: Site, open_context: OpenContext) -> None:
    participant, count = open_video(site, open_context, java_script_enabled=False)
    assert shown(participant.page) == list(range(1, count + 1))
    expect(participant.page.locator(".player__panel")).to_be_hidden()


def test_the_announced_actions_stand_below_it(video: tuple[Participant, int]) -> None:
    participant, _ = video
    announced = participant.page.locator(".announced li").all_text_contents()
    assert len(announced) == 2
    assert all(re.search(r"\w", words) for words in announced)


def test_below_it_the_same_can_be_read(site: Site, open_context: OpenContext) -> None:
    participant, count = open_video(site, open_context, java_script_enabled=False)
    page = participant.page
    expect(page.locator(".twin li").first).to_be_hidden()
    page.locator(".twin summary").click()
    told = page.locator(".twin li").all_inner_texts()
    alts = [str(picture.get_attribute("alt")) for picture in page.locator(".player img").all()]
    actions = page.locator(".player .strip__words").all_text_contents()
    assert len(told) == count
    assert all(words.startswith(alt) for words, alt in zip(told, alts, strict=True))
    assert all(words.endswith(action) for words, action in zip(told, actions, strict=False))
