"""Who gets a place in the study: people until the quota is reached, bots beside them, those with a new link."""

from collections.abc import Callable
from pathlib import Path

from flask import Flask

from tests.web.bundles import FILLED_IN, read_study, write_bundle
from tests.web.people import SAME_SITE, Visitor, hidden_nonce
from tests.web.reading import ask
from webapp.config import Config
from webapp.storage.helping import make_link
from webapp.storage.instance import note_address, only_server, running_server
from webapp.views.services import services_of, utc_now
from webapp.views.tokens import bot_pass

StartApp = Callable[[Config], Flask]


def live(instance: Path, start_app: StartApp, **changes: object) -> Flask:
    write_bundle(instance, read_study(**FILLED_IN, **changes))
    return start_app(Config(instance, live=True))


def agree_as_a_bot(app: Flask, shown: str) -> Visitor:
    bot = Visitor(app)
    form = {"agree": "yes", "nonce": hidden_nonce(bot.get("/"))}
    bot.client.post("/consent", data=form, headers=SAME_SITE | {"Xar-Bot": shown})
    return bot


def test_whoever_comes_when_all_places_are_taken_is_told_and_nothing_is_kept(
    instance: Path, start_app: StartApp
) -> None:
    app = live(instance, start_app, quota=1)
    first, second = Visitor(app), Visitor(app)
    first.agree()
    answer = second.agree()
    assert answer.status_code == 503
    assert "All places are taken" in answer.text
    assert "set-cookie" not in answer.headers or "participant" not in answer.headers["set-cookie"]
    assert ask(instance, "SELECT count(*) FROM participants") == [(1,)]
    first.post("/leave")
    assert second.agree().status_code == 303


def test_a_program_that_knows_the_pass_takes_part_as_a_bot_even_of_a_live_study(
    instance: Path, start_app: StartApp
) -> None:
    app = live(instance, start_app, quota=1)
    bot = agree_as_a_bot(app, bot_pass(services_of(app).secret))
    bot.walk()
    assert bot.place() == "/done"
    assert Visitor(app).agree().status_code == 303
    assert ask(instance, "SELECT mode FROM participants ORDER BY id") == [("bot",), ("live",)]


def test_a_wrong_pass_makes_nobody_a_bot(instance: Path, start_app: StartApp) -> None:
    app = live(instance, start_app)
    agree_as_a_bot(app, "0" * 64)
    assert ask(instance, "SELECT mode FROM participants") == [("live",)]


def test_a_link_made_by_a_researcher_lets_another_browser_go_on(app: Flask, instance: Path) -> None:
    lost, found = Visitor(app), Visitor(app)
    lost.agree()
    lost.walk(last=4)
    ((code,),) = ask(instance, "SELECT code FROM participants")
    token = make_link(services_of(app).database, str(code), "They lost it", "boss", utc_now())
    assert found.get(f"/resume/{token}").status_code == 200
    assert found.post(f"/resume/{token}").status_code == 303
    assert found.place() == "/study/5"
    found.walk(first=5)
    assert found.place() == lost.place() == "/done"


def test_the_address_of_a_server_is_known_while_it_runs(tmp_path: Path) -> None:
    assert running_server(tmp_path) is None
    with only_server(tmp_path):
        assert running_server(tmp_path) is None
        note_address(tmp_path, "http://127.0.0.1:8000")
        assert running_server(tmp_path) == "http://127.0.0.1:8000"
    assert running_server(tmp_path) is None
