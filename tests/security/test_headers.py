"""Every answer has exactly the same strict headers: every route, every method, every status."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from flask import Flask, Response, abort
from werkzeug.datastructures import Headers

from tests.security.routes import CASES, Case, Who
from tests.security.stages import Running, filled, prepare
from tests.security.strict import ALWAYS, NEVER, faults
from tests.web.people import SAME_SITE, Visitor
from tests.web.researchers import sign_in
from webapp.config import Config
from webapp.views import security
from webapp.views.services import services_of

METHODS = ("GET", "HEAD", "OPTIONS", "POST", "PUT", "TRACE")
RAISED = (400, 403, 404, 405, 408, 409, 410, 413, 414, 415, 422, 429, 431, 500, 501, 502, 503, 504)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("headers")
    one = Running(prepare("unblinded", folder / "stage"), folder / "copy")
    yield one
    one.close()


def is_kept(case: Case, status: int) -> bool:
    return case.rule.startswith(("/static/", "/pictures/")) and status in {200, 304}


@pytest.mark.parametrize("who", ["nobody", "A", "owner"])
def test_every_route_has_them_by_every_method_from_here_and_from_elsewhere(running: Running, who: Who) -> None:
    statuses, wrong = Counter[int](), []
    for case in CASES:
        if case.stage == "driving":
            continue
        client, address = running.client(who), filled(case.address, running.prepared.words)
        for method in METHODS:
            # Where something would be stored it comes from elsewhere, so that all requests meet the same state.
            is_safe = method != "POST" or case.method == "GET" or "+" not in case.said[who]
            headers = SAME_SITE if is_safe else {"Sec-Fetch-Site": "cross-site"}
            form = {name: filled(value, running.prepared.words) for name, value in case.form.items()}
            answer = client.open(address, method=method, headers=headers, data=form if method == "POST" else None)
            kept = is_kept(case, answer.status_code) and method in {"GET", "HEAD"}
            found = faults(answer, is_kept=kept)
            statuses[answer.status_code] += 1
            wrong += [f"{method} {address}: {answer.status} has {fault}" for fault in found]
            answer.close()
    assert wrong == []
    seen = {"nobody": {200, 303, 401, 403, 404, 405, 422}, "A": {200, 303, 403, 404}, "owner": {200, 303, 403, 422}}
    assert seen[who] <= set(statuses)


@pytest.mark.parametrize("https", [False, True])
@pytest.mark.parametrize("status", RAISED)
def test_every_error_has_them(instance: Path, start_app: Callable[[Config], Flask], status: int, https: bool) -> None:
    app = start_app(Config(instance, https=https))

    def fail() -> str:
        abort(status)

    app.add_url_rule("/fails", view_func=fail)
    for method in ("GET", "HEAD"):
        answer = app.test_client().open("/fails", method=method)
        assert answer.status_code == status
        assert faults(answer, https=https) == []


def test_an_exception_has_them(app: Flask) -> None:
    app.add_url_rule("/fails", view_func=lambda: str(1 / 0))
    answer = app.test_client().get("/fails")
    assert (answer.status_code, faults(answer)) == (500, [])


def test_what_a_browser_has_already_has_them(app: Flask) -> None:
    digest = next(services_of(app).config.instance.rglob("*.png")).stem
    first = app.test_client().get(f"/pictures/{digest}.png")
    second = app.test_client().get(f"/pictures/{digest}.png", headers={"If-None-Match": first.headers["ETag"]})
    assert (second.status_code, faults(second, is_kept=True)) == (304, [])


def test_too_much_another_host_and_too_many_guesses_have_them(app: Flask) -> None:
    client = app.test_client()
    for answer in (
        client.post("/consent", data={"x": "x" * 70_000}, headers=SAME_SITE),
        client.get("/", headers={"Host": "evil.example"}),
        client.get("/study/99999999999999999999999999"),
        client.get("/%00"),
        client.get("/researcher"),
        client.get("//evil.example/"),
    ):
        assert answer.status_code in {308, 400, 403, 404, 413}
        assert faults(answer) == []
    guesses = [sign_in(Visitor(app), "nobody", "wrong password") for _ in range(10)]
    assert {guess.status_code for guess in guesses} == {422, 429}
    assert [fault for guess in guesses for fault in faults(guess)] == []


def test_answers_depend_on_nothing_that_is_not_told(app: Flask) -> None:
    """Caches are told that pages depend on the cookie; nothing may be kept anyway."""
    answer = app.test_client().get("/", headers={"Accept-Encoding": "gzip"})
    assert set(re.split(", *", answer.headers["Vary"])) == {"Cookie", "Accept-Encoding"} | (
        {"Accept-Language"} if "Accept-Language" in answer.headers["Vary"] else set()
    )


def test_a_header_that_is_missing_wrong_or_too_much_is_found(app: Flask, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control."""
    for name in ALWAYS:
        with monkeypatch.context() as context:
            context.setattr(security, "HEADERS", {key: value for key, value in security.HEADERS.items() if key != name})
            assert len(faults(app.test_client().get("/"))) == 1
    loose = security.HEADERS | {"Content-Security-Policy": "default-src *"}
    monkeypatch.setattr(security, "HEADERS", loose)
    assert len(faults(app.test_client().get("/"))) == 1
    app.after_request_funcs.setdefault(None, []).append(_tell_too_much)
    assert len(faults(app.test_client().get("/"))) == 1 + len(NEVER)


def _tell_too_much(response: Response) -> Response:
    response.headers.extend(Headers([(name, "x") for name in NEVER]))
    return response
