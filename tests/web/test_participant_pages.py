import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from flask import Flask

from tests.web.bundles import FILLED_IN, read_study, write_bundle
from tests.web.people import ITEMS, NUM_PAGES, SAME_SITE, Clock, Visitor, filled, hidden_nonce
from tests.web.reading import ask, num_rows, stored_ratings
from webapp.config import Config, ConfigError
from webapp.storage.participants import hash_token

_COUNTS = "SELECT (SELECT count(*) FROM pages), (SELECT count(*) FROM ratings)"

StartApp = Callable[[Config], Flask]


def test_a_participant_goes_through_the_whole_study(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    assert visitor.agree().headers["Location"] == "/study/1"
    for number in range(1, NUM_PAGES + 1):
        expected = "/done" if number == NUM_PAGES else f"/study/{number + 1}"
        assert visitor.answer(number).headers["Location"] == expected
    assert visitor.get("/done").status_code == 200
    assert visitor.place() == "/done"
    for (_, number), ratings in stored_ratings(instance).items():
        sent = filled(number, "")
        assert ratings == {item: int(sent[f"rating-{item}"]) for item in ITEMS}
    assert num_rows(instance, "ratings") == 15
    times = ask(instance, "SELECT response_time_ms FROM ratings WHERE item = 'general' ORDER BY page_number")
    assert times == [(1000 * number + 2,) for number in (3, 5, 7, 9, 11)]


def test_every_page_shows_what_its_trial_says(app: Flask) -> None:
    visitor = Visitor(app)
    visitor.agree()
    for number in range(1, NUM_PAGES + 1):
        text = visitor.get(f"/study/{number}").text
        assert f"Step {number} of {NUM_PAGES}" in text
        assert len(re.findall(r'type="radio"', text)) == (15 if number >= 3 and number % 2 else 0)
        assert "checked" not in text
        visitor.answer(number)


def test_nothing_is_stored_before_the_consent(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    for path in ("/", "/declined", "/study", "/study/1", "/leave", "/done", "/left", "/pictures/x.png"):
        visitor.get(path)
    assert num_rows(instance, "participants") == 0


def test_consent_without_the_tick_stores_nothing_and_asks_again(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    for form in ({}, {"agree": "no"}):
        answer = visitor.post("/consent", form)
        assert answer.status_code == 422
        assert 'href="#agree"' in answer.text
        assert "Set-Cookie" not in answer.headers
    assert num_rows(instance, "participants") == 0


def test_the_same_consent_sent_twice_enrols_once(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    nonce = hidden_nonce(visitor.get("/"))
    impatient = app.test_client(use_cookies=False)
    form = {"agree": "yes", "nonce": nonce}
    cookies = {impatient.post("/consent", data=form, headers=SAME_SITE).headers["Set-Cookie"] for _ in range(3)}
    assert len(cookies) == 1
    visitor.post("/consent", form)
    assert visitor.post("/consent", {"agree": "yes"}).headers["Location"] == "/study/1"
    assert num_rows(instance, "participants") == 1


def test_whoever_has_begun_goes_on_from_the_welcome_page(app: Flask) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=2)
    assert visitor.get("/").headers["Location"] == "/study/3"


def test_the_next_person_at_the_same_machine_begins_anew(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk()
    assert visitor.get("/").status_code == 200
    assert visitor.agree().headers["Location"] == "/study/1"
    assert num_rows(instance, "participants") == 2


def test_a_page_with_missing_answers_comes_back_with_the_given_ones_and_stores_nothing(
    app: Flask, instance: Path
) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=2)
    form = {"nonce": visitor.nonce(3), "rating-likeliness": "4", "rating-general": "9"}
    answer = visitor.post("/study/3", form)
    assert answer.status_code == 422
    assert re.findall(r'name="rating-(\w+)" value="(\d)" checked', answer.text) == [("likeliness", "4")]
    assert re.findall(r'href="#rating-(\w+)-1"', answer.text) == ["loveliness", "general"]
    assert "<title>Error: " in answer.text
    assert hidden_nonce(answer) == form["nonce"]
    assert num_rows(instance, "ratings") == 0
    assert visitor.place() == "/study/3"
    assert visitor.post("/study/3", filled(3, form["nonce"])).headers["Location"] == "/study/4"


@pytest.mark.parametrize(
    ("sent", "stored"),
    [("0", 0), ("1234", 1234), ("86400000", 86_400_000), ("86400001", None), ("-1", None), ("1.5", None), ("", None)],
)
def test_a_response_time_that_makes_no_sense_is_none_and_never_costs_a_rating(
    app: Flask, instance: Path, sent: str, stored: int | None
) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=2)
    assert visitor.answer(3, time_general=sent).status_code == 303
    assert ask(instance, "SELECT response_time_ms FROM ratings WHERE item = 'general'") == [(stored,)]


def test_without_scripts_there_are_ratings_and_no_times(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=2)
    form = {name: value for name, value in filled(3, visitor.nonce(3)).items() if not name.startswith("time-")}
    assert visitor.post("/study/3", form).status_code == 303
    assert ask(instance, "SELECT count(*), count(response_time_ms) FROM ratings") == [(3, 0)]


def test_the_answer_is_on_disk_before_the_redirect_is_sent(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    visitor.agree()
    seen: list[tuple[object, ...]] = []
    inner = app.wsgi_app

    def watch(environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        def start(status: str, *rest: Any) -> Any:  # noqa: ANN401
            (numbers,) = ask(instance, _COUNTS)
            if environ["REQUEST_METHOD"] == "POST":
                seen.append((status[:3], *numbers))
            return start_response(status, *rest)

        return inner(environ, start)

    app.wsgi_app = watch  # type: ignore[method-assign]
    visitor.walk()
    assert seen == [("303", number, 3 * ((number - 1) // 2)) for number in range(1, NUM_PAGES + 1)]


def test_leaving_is_asked_confirmed_and_final(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=3)
    assert visitor.get("/leave").status_code == 200
    assert visitor.place() == "/study/4"
    form = filled(4, visitor.nonce(4))
    visitor.post("/leave")
    assert visitor.place() == "/left"
    assert visitor.get("/left").status_code == 200
    for path in ("/study/4", "/leave", "/done"):
        assert visitor.get(path).headers["Location"] == "/left"
    assert visitor.post("/study/4", form).headers["Location"] == "/left"
    assert num_rows(instance, "pages") == 3
    assert visitor.get("/").status_code == 200


def test_leaving_after_the_end_changes_nothing(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk()
    assert visitor.get("/leave").headers["Location"] == "/done"
    visitor.post("/leave")
    assert visitor.place() == "/done"
    assert ask(instance, "SELECT withdrawn_at FROM participants") == [(None,)]


def test_the_end_and_the_farewell_are_only_for_those_who_came_there(app: Flask) -> None:
    visitor = Visitor(app)
    visitor.agree()
    assert visitor.get("/done").headers["Location"] == "/study/1"
    assert visitor.get("/left").headers["Location"] == "/study/1"


@pytest.mark.parametrize("path", ["/study", "/study/1", "/leave", "/left", "/done"])
def test_without_a_place_the_study_says_so_and_points_to_the_beginning(app: Flask, path: str) -> None:
    stranger = Visitor(app)
    stranger.client.set_cookie("participant", "0" * 64)
    answer = stranger.get(path)
    assert answer.status_code == 403
    assert "cookie" in answer.text
    assert 'href="/"' in answer.text


@pytest.mark.parametrize("path", ["/study/0", "/study/12", f"/study/{10**30}", "/study/-1", "/study/x", "/nowhere"])
def test_pages_that_do_not_exist_are_not_found(app: Flask, path: str) -> None:
    visitor = Visitor(app)
    visitor.agree()
    assert visitor.get(path).status_code == 404
    assert visitor.post(path, {"nonce": "0" * 32}).status_code in {404, 405}


def test_pictures_are_found_by_their_digest_alone_and_kept_for_ever(app: Flask) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=1)
    (source, *_) = re.findall(r'src="(/pictures/[0-9a-f]{64}\.png)"', visitor.get("/study/2").text)
    answer = visitor.get(source)
    assert answer.mimetype == "image/png"
    assert answer.data.startswith(b"\x89PNG")
    assert {"public", "immutable", "max-age=31536000"} <= set(answer.headers["Cache-Control"].split(", "))
    again = visitor.client.get(source, headers={"If-None-Match": answer.headers["ETag"]}, buffered=True)
    assert again.status_code == 304
    for other in ("0" * 64, "..%2fcatalogue", "manifest"):
        assert visitor.get(f"/pictures/{other}.png").status_code == 404


def test_a_picture_that_was_changed_under_the_server_is_not_sent(
    app: Flask, instance: Path, caplog: pytest.LogCaptureFixture
) -> None:
    visitor = Visitor(app)
    visitor.agree()
    visitor.walk(last=1)
    (source, *_) = re.findall(r'src="(/pictures/[0-9a-f]{64}\.png)"', visitor.get("/study/2").text)
    assert visitor.get(source).status_code == 200
    (file,) = (instance / "bundles").glob(f"*{source}")
    file.write_bytes(file.read_bytes()[:-1] + b"\0")
    answer = visitor.get(source)
    assert (answer.status_code, answer.mimetype) == (500, "text/html")
    assert "immutable" not in answer.headers["Cache-Control"]
    assert f"{source.removeprefix('/')} was changed" in caplog.text


def test_the_cookie_is_closed_and_the_database_holds_only_its_hash(app: Flask, instance: Path) -> None:
    visitor = Visitor(app)
    cookie = visitor.agree().headers["Set-Cookie"]
    assert {"HttpOnly", "SameSite=Lax", "Path=/"} <= set(cookie.split("; "))
    token = cookie.split(";")[0].removeprefix("participant=")
    assert len(token) == 64
    rows = ask(instance, "SELECT * FROM participants")
    assert hash_token(token) in rows[0]
    assert token not in str(rows)


def test_by_https_the_cookie_is_bound_to_host_and_encryption(instance: Path, start_app: StartApp) -> None:
    visitor = Visitor(start_app(Config(instance, https=True)))
    cookie = visitor.agree().headers["Set-Cookie"]
    assert cookie.startswith("__Host-participant=")
    assert "Secure" in cookie.split("; ")


def test_the_test_run_says_so_on_every_page_and_live_does_not(instance: Path, start_app: StartApp) -> None:
    banner = "test run"
    study = read_study(**FILLED_IN)
    write_bundle(instance, study)
    for live in (False, True):
        visitor = Visitor(start_app(Config(instance, live=live)))
        paths = ("/", "/declined", "/nowhere", "/researcher/sign-in")
        pages = [visitor.get(path) for path in paths]
        visitor.agree()
        pages.append(visitor.get("/study/1"))
        assert [banner in page.text for page in pages] == [not live] * 5


def test_live_data_are_not_collected_while_the_study_file_holds_placeholders(
    instance: Path, start_app: StartApp
) -> None:
    with pytest.raises(ConfigError, match="contact, ethics_approval, retention_until"):
        start_app(Config(instance, live=True))
    write_bundle(instance, read_study(**(FILLED_IN | {"contact": "<whom to ask>"})))
    with pytest.raises(ConfigError, match="file's contact, still"):
        start_app(Config(instance, live=True))
    assert not (instance / "xar.sqlite3").exists()


def test_a_test_run_is_not_continued_as_live(instance: Path, start_app: StartApp) -> None:
    write_bundle(instance, read_study(**FILLED_IN))
    config = Config(instance)
    visitor = Visitor(start_app(config))
    visitor.agree()
    visitor.app = start_app(replace(config, live=True))
    token = visitor.client.get_cookie("participant")
    assert token is not None
    later = Visitor(visitor.app)
    later.client.set_cookie("participant", token.value)
    assert later.get("/study").status_code == 403
    later.agree()
    assert ask(instance, "SELECT mode FROM participants ORDER BY id") == [("test",), ("live",)]


def test_a_participant_goes_on_after_a_restart(instance: Path, start_app: StartApp) -> None:
    visitor = Visitor(start_app(Config(instance)))
    visitor.agree()
    visitor.walk(last=3)
    form = filled(4, visitor.nonce(4))
    token = visitor.client.get_cookie("participant")
    assert token is not None
    again = Visitor(start_app(Config(instance)))
    again.client.set_cookie("participant", token.value)
    assert again.post("/study/4", form).headers["Location"] == "/study/5"


def test_a_participant_finishes_with_the_version_that_was_begun(
    instance: Path, start_app: StartApp, clock: Clock
) -> None:
    old = write_bundle(instance, read_study())
    visitor = Visitor(start_app(Config(instance)))
    visitor.agree()
    token = visitor.client.get_cookie("participant")
    assert token is not None
    new = write_bundle(instance, read_study(seed=7))
    assert new != old
    clock.wait(hours=1)
    later = Visitor(start_app(Config(instance)))
    later.client.set_cookie("participant", token.value)
    later.walk()
    Visitor(later.app).agree()
    assert ask(instance, "SELECT study_version FROM participants ORDER BY id") == [(old,), (new,)]


def test_the_facts_are_those_of_the_version_that_was_begun(instance: Path, start_app: StartApp) -> None:
    write_bundle(instance, read_study(facts=("goal", "key_and_door")))
    visitor = Visitor(start_app(Config(instance)))
    visitor.agree()
    token = visitor.client.get_cookie("participant")
    assert token is not None
    write_bundle(instance, read_study(facts=("goal", "a_later_fact")))
    later = Visitor(start_app(Config(instance)))
    later.client.set_cookie("participant", token.value)
    page = later.get("/study/1")
    assert page.status_code == 200
    assert "pick up the key" in page.text


def test_when_the_begun_version_is_gone_the_participant_is_told(instance: Path, start_app: StartApp) -> None:
    old = write_bundle(instance, read_study())
    visitor = Visitor(start_app(Config(instance)))
    visitor.agree()
    token = visitor.client.get_cookie("participant")
    assert token is not None
    write_bundle(instance, read_study(seed=7))
    (instance / "bundles" / old / "catalogue.json").unlink()
    later = Visitor(start_app(Config(instance)))
    later.client.set_cookie("participant", token.value)
    answer = later.get("/study/1")
    assert answer.status_code == 410
    assert "The study has changed" in answer.text
