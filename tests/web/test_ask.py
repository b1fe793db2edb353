"""The open page on which anybody asks the agent; its world is drawn in `tests.web.bundles`."""

import html
import random
import re
from collections.abc import Callable
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

import pytest
from flask import Flask
from werkzeug.test import TestResponse

from tests.web.bundles import FILLED_IN, PATH, SUBGOALS, WAY, read_study, write_bundle
from tests.web.people import Visitor
from tests.web.reading import looking_into
from webapp.config import Config
from webapp.study.routes import MAX_ROUTE_ACTIONS

StartApp = Callable[[Config], Flask]
Query = dict[str, str]

LAYOUT = "experiment1-a"
WHOLE_WAY = " ".join(WAY)


@pytest.fixture
def visitor(app: Flask) -> Visitor:
    return Visitor(app)


def ask(visitor: Visitor, **query: str) -> TestResponse:
    """Open an address; `from_` stands for `from`."""
    return visitor.client.get("/ask", query_string={name.rstrip("_"): value for name, value in query.items()})


def query_of(answer: TestResponse) -> Query:
    """Return the question in the address that an answer leads to."""
    assert answer.status_code == 303, answer.text
    return dict(parse_qsl(urlsplit(answer.headers["Location"]).query))


def press(visitor: Visitor, action: str, **query: str) -> Query:
    return query_of(ask(visitor, **query, action=action))


def words(answer: TestResponse) -> str:
    """Return what a page says, without its tags."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", answer.text)).split())


def steps(answer: TestResponse) -> list[str]:
    return [" ".join(words_of(step).split()) for step in re.findall(r'<li class="route__step.*?</li>', answer.text)]


def words_of(part: str) -> str:
    return html.unescape(re.sub(r"<[^>]*>", " ", part))


def moments(answer: TestResponse) -> list[str]:
    """Return the moments of an answer, the one where the route begins left out."""
    return re.findall(r'<li class="moment(?: moment--explanation)?">.*?<div class="stage', answer.text, re.DOTALL)


def pictures(answer: TestResponse) -> list[str]:
    """Return the words of the pictures in an answer, strip by strip."""
    answered = answer.text.partition('id="answer"')[2]
    strips = re.findall(r'<ol class="strip".*?</ol>', answered, re.DOTALL)
    return ["|".join(re.findall(r'alt="([^"]*)"', strip)) for strip in strips]


def view(state: int) -> str:
    return f"View {state}."


def every_row(instance: Path) -> dict[str, list[tuple[object, ...]]]:
    with looking_into(instance) as connection:
        return {name: connection.ask(f"SELECT * FROM {name}") for name in connection.tables()}  # noqa: S608


def test_nothing_is_stored_and_no_cookie_is_set(visitor: Visitor, instance: Path) -> None:
    before = every_row(instance)
    answers = [
        ask(visitor),
        ask(visitor, lang="ja"),
        ask(visitor, lang="tlh"),
        ask(visitor, layout=LAYOUT, route=WHOLE_WAY, ask="yes"),
        ask(visitor, layout=LAYOUT, action="left"),
        ask(visitor, layout=LAYOUT, route="jump"),
        ask(visitor, layout="nowhere"),
        visitor.client.post("/ask", data={"route": "left"}, headers={"Sec-Fetch-Site": "same-origin"}),
    ]
    assert [answer.status_code for answer in answers] == [200, 200, 200, 200, 303, 422, 422, 405]
    assert [answer.headers.get("Set-Cookie") for answer in answers] == [None] * len(answers)
    assert every_row(instance) == before


def test_a_study_without_the_section_has_no_such_page(instance: Path, start_app: StartApp) -> None:
    write_bundle(instance, read_study(ask=None))
    visitor = Visitor(start_app(Config(instance)))
    assert ask(visitor).status_code == 404
    assert ask(visitor, layout=LAYOUT, route="left").status_code == 404
    assert "/ask" not in visitor.get("/").text


def test_a_test_run_offers_every_layout_and_the_welcome_page_links_to_it(visitor: Visitor) -> None:
    page = ask(visitor)
    assert page.status_code == 200
    linked = re.findall(r'href="/ask\?layout=([a-z0-9-]+)#question"', page.text)
    assert linked == list(read_study().layouts)
    assert page.text.count('class="picture"') == len(linked)
    assert 'id="question"' not in page.text
    assert 'href="/ask"' in visitor.get("/").text


def test_a_live_study_keeps_back_the_layouts_that_participants_judge(instance: Path, start_app: StartApp) -> None:
    write_bundle(instance, read_study(**FILLED_IN))
    visitor = Visitor(start_app(Config(instance, live=True)))
    assert re.findall(r'href="/ask\?layout=([a-z0-9-]+)', ask(visitor).text) == ["simulation"]
    assert ask(visitor, layout="simulation", route="left").status_code == 200
    refused = ask(visitor, layout=LAYOUT, route="left", ask="yes", lang="ja")
    assert refused.status_code == 404
    assert f"「{LAYOUT}」" in words(refused)
    assert "moment" not in refused.text
    assert 'href="/ask?lang=ja"' in refused.text
    assert 'href="/ask"' not in visitor.get("/").text


def test_a_live_study_that_uses_every_layout_says_that_nothing_can_be_asked(
    instance: Path, start_app: StartApp
) -> None:
    study = read_study(**FILLED_IN)
    used = tuple(layout for layout in study.layouts if layout != "simulation")
    write_bundle(instance, study.model_copy(update={"layouts": used}))
    visitor = Visitor(start_app(Config(instance, live=True)))
    for query in ({}, {"layout": LAYOUT}, {"layout": "nowhere"}):
        answer = ask(visitor, **query)
        assert answer.status_code == 404
        assert "All worlds belong to a study" in words(answer)
        assert 'class="button" href="/"' in answer.text


def test_buttons_make_the_route_longer_and_shorter_and_the_address_says_all_of_it(visitor: Visitor) -> None:
    query = press(visitor, "left", layout=LAYOUT)
    assert query == {"layout": LAYOUT, "route": "left"}
    query = press(visitor, "toggle", **query)
    assert query == {"layout": LAYOUT, "route": "left toggle"}
    assert press(visitor, "undo", **query) == {"layout": LAYOUT, "route": "left"}
    assert press(visitor, "clear", **query) == {"layout": LAYOUT}
    assert press(visitor, "undo", layout=LAYOUT) == {"layout": LAYOUT}
    assert press(visitor, "pickup", layout=LAYOUT, route="l, O", ask="yes") == {
        "layout": LAYOUT,
        "route": "left toggle pickup",
    }
    assert press(visitor, "clear", layout=LAYOUT, route="what is this") == {"layout": LAYOUT}


def test_the_page_shows_what_is_seen_after_the_route_and_each_of_its_steps(visitor: Visitor) -> None:
    start = ask(visitor, layout=LAYOUT)
    assert f'alt="{view(PATH.states[0])}"' in start.text
    assert "This is where you start." in words(start)
    for number in range(1, len(WAY)):
        page = ask(visitor, layout=LAYOUT, route=" ".join(WAY[:number]))
        (shown,) = re.findall(r'<img class="picture" data-view [^>]*alt="([^"]*)"', page.text)
        assert shown == view(PATH.states[number])
        assert len(steps(page)) == number
        assert "Nothing happened" not in words(page)
    page = ask(visitor, layout=LAYOUT, route="toggle pickup forward")
    assert steps(page) == ["open the door (nothing happens)", "pick up the key", "go forward"]
    assert "You went forward." in words(page)
    assert "Nothing happened." in words(ask(visitor, layout=LAYOUT, route="toggle"))


def test_at_the_goal_the_route_ends_and_what_was_written_after_it_is_not_used(visitor: Visitor) -> None:
    page = ask(visitor, layout=LAYOUT, route=f"{WHOLE_WAY} left left")
    assert [step.endswith("(not used)") for step in steps(page)] == [False] * 7 + [True] * 2
    assert "2 actions after that are not used" in words(page)
    assert "This is the goal." in words(page)
    assert 'value="forward"' not in page.text
    assert 'name="ask" value="yes"' in page.text


def test_a_route_that_reaches_the_goal_lacks_nothing_and_is_compared_with_the_agents(visitor: Visitor) -> None:
    page = ask(visitor, layout=LAYOUT, route=f"right left {WHOLE_WAY}", ask="yes")
    assert "Your route reaches the goal in 9 steps, so nothing is missing." in words(page)
    assert "The agent itself takes 7 steps." in words(page)
    assert len(moments(page)) == len(SUBGOALS)
    assert all("On your route too" in moment for moment in moments(page))
    assert "The explanation" not in words(page)
    states = PATH.states
    pairs = [f"{view(states[0])}|{view(states[1])}", f"{view(states[4])}|{view(states[5])}", view(states[7])]
    assert pictures(page) == [view(states[0]), *pairs]


def test_a_route_that_ends_on_the_way_lacks_the_rest_and_the_first_of_it_is_the_explanation(visitor: Visitor) -> None:
    page = ask(visitor, layout=LAYOUT, route=" ".join(WAY[:4]), ask="yes")
    assert "Your route does not reach the goal." in words(page)
    opens, arrives = moments(page)
    assert "The explanation" in opens
    assert "Step 5 in en: toggle." in opens
    assert "moment--explanation" in opens
    assert "Also missing" in arrives
    assert "Step 7 in en: forward." in arrives
    assert "moment--explanation" not in arrives
    states = PATH.states
    assert pictures(page) == [view(states[0]), f"{view(states[4])}|{view(states[5])}", view(states[7])]
    assert re.search(r"on your route already\s+Step 1 in en: pickup\.", words(page))


def test_without_a_route_everything_is_missing(visitor: Visitor) -> None:
    page = ask(visitor, layout=LAYOUT, ask="yes")
    assert [moment.count("Also missing") for moment in moments(page)] == [0, 1, 1]
    assert "None of the moments that matter is on your route yet." in words(page)


def test_the_agent_answers_only_when_it_is_asked(visitor: Visitor) -> None:
    assert moments(ask(visitor, layout=LAYOUT, route="left")) == []


def test_a_question_may_begin_later_on_the_agents_way(visitor: Visitor) -> None:
    page = ask(visitor, layout=LAYOUT, from_="3")
    assert f'alt="{view(PATH.states[2])}"' in page.text
    assert '<option value="3" selected>' in page.text
    assert page.text.count("<option") == len(WAY)
    page = ask(visitor, layout=LAYOUT, route=" ".join(WAY[2:]), from_="3", ask="yes")
    assert "Your route reaches the goal in 5 steps" in words(page)
    assert "The agent itself takes 5 steps." in words(page)
    assert pictures(page)[0] == view(PATH.states[2])
    assert len(moments(page)) == 2
    assert press(visitor, "left", layout=LAYOUT, from_="3") == {"layout": LAYOUT, "route": "left", "from": "3"}
    assert query_of(ask(visitor, layout=LAYOUT, from_="1")) == {"layout": LAYOUT}


@pytest.mark.parametrize(
    ("query", "message", "kept"),
    [
        ({"route": "left jump"}, "“jump” is no action. Use forward, left, right, pickup or toggle", ">left jump<"),
        ({"route": "left", "action": "fly"}, "“fly” is no action", ">left<"),
        ({"route": "f " * 201}, "Your route has 201 actions. Use 200 at most.", f">{'f ' * 201}<"),
        ({"route": "left", "from": "8"}, "no step “8”. Use a number from 1 to 7.", ">left<"),
        ({"route": "l", "from": "x"}, "no step “x”", ">l<"),
        ({"route": "left", "from": "٣"}, "no step “٣”", ">left<"),
        ({"route": "left", "from": "-1"}, "no step “-1”", ">left<"),
        ({"route": "jump", "from": "3"}, "“jump” is no action", '<option value="3" selected>'),
        ({"route": "<script>", "ask": "yes"}, "“<script>” is no action", "&lt;script&gt;"),
        ({"route": "x" * 5000}, f"“{'x' * 40}…” is no action", "x" * 5000),
    ],
)
def test_wrong_input_is_named_with_the_wish_and_the_rest_is_kept(
    visitor: Visitor, query: Query, message: str, kept: str
) -> None:
    page = ask(visitor, layout=LAYOUT, **query)
    assert page.status_code == 422
    assert message in words(page)
    assert kept in page.text
    assert "<script>" not in page.text
    assert page.text.count('aria-invalid="true"') == 1
    (control,) = re.findall(r'error-summary__list">\s*<li><a href="#([a-z]+)"', page.text)
    assert f'id="{control}"' in page.text
    assert f'value="{LAYOUT}"' in page.text
    assert moments(page) == []


def test_an_unknown_layout_is_named_and_the_route_goes_along_to_the_one_that_is_chosen(visitor: Visitor) -> None:
    page = ask(visitor, layout="nowhere", route="left jump", from_="2")
    assert page.status_code == 422
    assert "There is no world “nowhere”." in words(page)
    assert f'href="/ask?layout={LAYOUT}&amp;route=left+jump&amp;from=2#question"' in page.text
    page = ask(visitor, route="left")
    assert page.status_code == 200
    assert f'href="/ask?layout={LAYOUT}&amp;route=left#question"' in page.text


def test_the_longest_route_can_be_asked_about_and_no_button_makes_it_longer(visitor: Visitor) -> None:
    longest = " ".join(["left"] * MAX_ROUTE_ACTIONS)
    assert len(steps(ask(visitor, layout=LAYOUT, route=longest, ask="yes"))) == 200
    page = ask(visitor, layout=LAYOUT, route=longest, action="left")
    assert page.status_code == 422
    assert "Your route has 201 actions." in words(page)
    assert len(steps(page)) == 200


def test_the_page_speaks_the_language_of_its_address_else_the_browsers(visitor: Visitor) -> None:
    japanese = {"Accept-Language": "ja, en;q=0.5"}
    pages = [
        visitor.client.get(
            "/ask", query_string={"layout": LAYOUT, "route": "left", "ask": "yes", **lang}, headers=asked
        )
        for lang in ({}, {"lang": "en"}, {"lang": "ja"}, {"lang": "tlh"})
        for asked in ({}, japanese)
    ]
    spoken = [re.findall(r'<html lang="([a-z]+)">', page.text)[0] for page in pages]
    assert spoken == ["en", "ja", "en", "en", "ja", "ja", "en", "ja"]
    assert "Step 1 in ja: pickup." in pages[1].text
    assert ["not available in the language" in words(page) for page in pages] == [False] * 6 + [True, False]


def test_the_language_of_the_address_goes_along(visitor: Visitor) -> None:
    page = ask(visitor, layout=LAYOUT, route="left", ask="yes", lang="ja")
    assert '<input type="hidden" name="lang" value="ja">' in page.text
    assert f'href="/ask?layout={LAYOUT}&amp;route=left&amp;ask=yes&amp;lang=en"' in page.text
    assert '&amp;lang=ja#question"' in page.text
    assert press(visitor, "left", layout=LAYOUT, lang="ja")["lang"] == "ja"
    assert 'name="lang"' not in ask(visitor, layout=LAYOUT).text
    assert 'name="lang"' not in ask(visitor, layout=LAYOUT, lang="tlh").text


def test_a_route_can_be_written_in_the_words_of_the_page(visitor: Visitor) -> None:
    query = {"layout": LAYOUT, "lang": "ja"}
    assert query_of(ask(visitor, route="鍵を拾う、左に向きを変える f", **query)) == {
        "route": "pickup left forward",
        **query,
    }


def test_every_question_has_one_address(visitor: Visitor) -> None:
    rng = random.Random(11)
    values = {
        "layout": [LAYOUT, "simulation"],
        "route": ["", "left", "f, F  toggle", WHOLE_WAY],
        "from": ["1", " 2", "07", ""],
        "ask": ["yes", "no", ""],
        "lang": ["en", "ja", "", "tlh"],
        "action": ["left", "undo", "clear", ""],
        "PROLIFIC_PID": ["0123456789abcdef01234567"],
    }
    for _ in range(150):
        chosen = {name: rng.choice(choices) for name, choices in values.items() if rng.random() < 0.6}
        answer = visitor.client.get("/ask", query_string=chosen | {"layout": LAYOUT})
        if answer.status_code == 303:
            assert set(query_of(answer)) <= {"layout", "route", "from", "ask", "lang"}
            answer = visitor.client.get(answer.headers["Location"])
        assert answer.status_code == 200
