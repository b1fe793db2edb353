"""Whatever a form holds: no rating is made up, no page is stored for others, and nothing is a failure of the server."""

from collections.abc import Iterator

import pytest
from flask import Flask

from tests.security.routes import CASES, Who
from tests.security.stages import Running, filled, prepare, stored
from tests.web.people import SAME_SITE, Visitor
from webapp.views.services import services_of

RATINGS = (
    "0",
    "6",
    "-1",
    "1000000000",
    "9" * 400,
    "1; DROP TABLE ratings",
    "1' OR '1'='1",
    "3.0",
    "3e0",
    "0x3",
    "٣",
    "\N{FULLWIDTH DIGIT THREE}",
    "+3",
    "",
    "\x00",
    "3\x00",
    "NaN",
    "true",
    "None",
    "[3]",
    "{{7*7}}",
    "${7*7}",
    "<b>3</b>",
)


TOKENS = ("", "0", "0" * 64, "f" * 64, "' OR 1=1 --", "../../etc/passwd", "%00", "a" * 4000, "null", "true", "\ud7ff")


pytestmark = pytest.mark.sqlite_only("everything that the file holds is compared")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("requests")
    one = Running(prepare("rating", folder / "stage"), folder / "copy")
    yield one
    one.close()


def right_form(running: Running) -> dict[str, str]:
    case = next(case for case in CASES if case.what == "the form of A" and case.stage == "rating")
    return {name: filled(value, running.prepared.words) for name, value in case.form.items()}


def post_page(running: Running, data: object, who: Who = "A", **settings: str):  # type: ignore[no-untyped-def]  # noqa: ANN201
    return running.client(who).post("/study/3", data=data, headers=SAME_SITE, **settings)


@pytest.mark.parametrize("rating", RATINGS)
def test_a_tampered_rating_is_refused_with_the_page(running: Running, rating: str) -> None:
    answer = post_page(running, right_form(running) | {"rating-general": rating})
    assert (answer.status_code, running.has_changed()) == (422, False)


@pytest.mark.parametrize("token", TOKENS)
def test_a_guessed_token_opens_nothing(running: Running, token: str) -> None:
    for name in ("participant", "researcher", "browser", "notice"):
        client = running.app.test_client()
        client.set_cookie(name, token)
        assert client.get("/study").status_code == 403
        assert client.get("/researcher/").headers["Location"] == "/researcher/sign-in"
        assert client.post("/study/3", data=right_form(running), headers=SAME_SITE).status_code == 403
    assert not running.has_changed()


@pytest.mark.parametrize("nonce", ["", "0" * 32, "the other's", "upper", "twice", "a list", "\x00", "long"])
def test_a_foreign_nonce_moves_nobody(running: Running, nonce: str) -> None:
    own = right_form(running)["nonce"]
    spoiled = {
        "the other's": own,
        "upper": own.upper() + "A",
        "twice": own * 2,
        "a list": f"[{own}]",
        "long": own * 900,
    }
    who: Who = "B" if nonce == "the other's" else "A"
    answer = post_page(running, right_form(running) | {"nonce": spoiled.get(nonce, nonce)}, who)
    assert (answer.status_code, answer.headers["Location"]) == (303, "/study/3")
    assert not running.has_changed()


def test_a_page_is_stored_in_the_controls_of_these_tests(running: Running) -> None:
    """The control: it is the spoiled field that is refused."""
    assert post_page(running, right_form(running)).headers["Location"] == "/study/4"
    assert running.has_changed()


def test_of_two_values_of_a_field_the_first_counts_and_queries_never_do(running: Running) -> None:
    form = [*right_form(running).items(), ("rating-general", "1"), ("nonce", "0" * 32)]
    client = running.client("A")
    answer = client.post(
        "/study/3?rating-general=5&nonce=x",
        data=_encoded(form),
        headers=SAME_SITE,
        content_type="application/x-www-form-urlencoded",
    )
    assert answer.headers["Location"] == "/study/4"
    text = stored(services_of(running.app).config.instance)
    assert "'general', 2" in text
    assert running.has_changed()
    without = {name: value for name, value in right_form(running).items() if name != "rating-general"}
    answer = running.client("A").post("/study/3?rating-general=5", data=without, headers=SAME_SITE)
    assert answer.status_code == 422
    assert not running.has_changed()


def test_fields_that_nobody_asked_for_change_nothing(running: Running) -> None:
    extra = {
        "participant_id": "2",
        "mode": "live",
        "kind": "none",
        "page": "9",
        "role": "admin",
        "token": "x",
        "rating-made_up": "5",
        "answer-made_up": "5",
        "__class__": "x",
        "rating": "5",
        "code": "AAAAAAAAAAAA",
    }
    assert post_page(running, right_form(running) | extra).headers["Location"] == "/study/4"
    with_extra = stored(services_of(running.app).config.instance)
    assert "made_up" not in with_extra
    assert "'live'" not in with_extra
    assert running.has_changed()


@pytest.mark.parametrize(
    ("content_type", "body"),
    [
        ("application/json", b'{"nonce": "NONCE", "rating-likeliness": 4, "rating-general": 2}'),
        ("text/plain", b"nonce=NONCE&rating-likeliness=4&rating-general=2"),
        ("application/xml", b'<!DOCTYPE x [<!ENTITY y SYSTEM "file:///etc/passwd">]><x>&y;</x>'),
        ("application/x-www-form-urlencoded; charset=utf-7", b"nonce=+AD4-"),
        ("application/x-www-form-urlencoded", b"nonce=%ff%fe&rating-likeliness=%c0%b4"),
        ("multipart/form-data", b"no boundary"),
        ("multipart/form-data; boundary=x", b"--x\r\nContent-Disposition: form-data\r\n\r\n\r\n--x--"),
        ("multipart/form-data; boundary=" + "x" * 500, b"--x"),
        ("", b"nonce=NONCE"),
    ],
)
def test_another_kind_of_body_is_no_form(running: Running, content_type: str, body: bytes) -> None:
    nonce = right_form(running)["nonce"].encode()
    answer = post_page(running, body.replace(b"NONCE", nonce), content_type=content_type)
    assert answer.status_code in {303, 400, 413, 415}
    assert answer.status_code != 303 or answer.headers["Location"] == "/study/3"
    assert not running.has_changed()


@pytest.mark.parametrize(
    "size", [{"x": "x" * 70_000}, {f"f{number}": "x" for number in range(20_000)}, {"x": "x" * 3_000_000}]
)
def test_too_much_is_refused(running: Running, size: dict[str, str]) -> None:
    assert post_page(running, size).status_code == 413
    parts = {f"part{number}": "x" for number in range(101)}
    assert post_page(running, parts, content_type="multipart/form-data").status_code == 413
    assert not running.has_changed()


@pytest.mark.parametrize("end", ["left", "done"])
def test_after_the_end_nothing_is_stored_any_more(app: Flask, end: str) -> None:
    visitor = Visitor(app)
    visitor.agree()
    nonces = [visitor.nonce(1)]
    if end == "left":
        visitor.post("/leave")
    else:
        visitor.walk()
    instance = services_of(app).config.instance
    before = stored(instance)
    for number in range(1, 12):
        for nonce in (*nonces, "0" * 32):
            answer = visitor.post(f"/study/{number}", {"nonce": nonce, "rating-general": "5"})
            assert (answer.status_code, answer.headers["Location"]) == (303, f"/{end}")
    assert visitor.post("/study/3/action", {"nonce": nonces[0], "action": "left", "step": "1"}).status_code in {
        303,
        404,
    }
    if end == "done":
        visitor.post("/leave")
    assert stored(instance) == before


def _encoded(fields: list[tuple[str, str]]) -> str:
    return "&".join(f"{name}={value}" for name, value in fields)
