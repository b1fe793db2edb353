"""Every address is closed unless a table opens it: each rule and method is asked by everybody who could."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from flask import Flask

from tests.security.routes import CASES, EVERYBODY, Case, Stage, Who
from tests.security.stages import Running, filled, prepare
from tests.web.people import SAME_SITE

METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT", "PROPFIND")


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[Stage, Running]]:
    folder = tmp_path_factory.mktemp("stages")
    running = {stage: Running(prepare(stage, folder / stage), folder / f"{stage}-copy") for stage in _stages()}
    yield running
    for one in running.values():
        one.close()


def _stages() -> list[Stage]:
    return sorted({case.stage for case in CASES})


def rules(app: Flask) -> set[tuple[str, str]]:
    """Every rule with every method that it has of its own; HEAD and OPTIONS follow from them."""
    return {
        (method, re.sub("^/static/[0-9a-f]{12}", "/static", rule.rule))
        for rule in app.url_map.iter_rules()
        for method in (rule.methods or set()) - {"HEAD", "OPTIONS"}
    }


def without_case(app: Flask) -> set[tuple[str, str]]:
    return rules(app) - {(case.method, case.rule) for case in CASES}


def test_every_address_stands_in_the_table(app: Flask) -> None:
    assert without_case(app) == set()
    assert {(case.method, case.rule) for case in CASES} <= rules(app)
    assert all(set(case.said) == set(EVERYBODY) for case in CASES)
    # The control: an address that somebody adds without saying who may use it is found.
    app.add_url_rule("/new", view_func=lambda: "x", methods=["GET", "PUT"])
    assert without_case(app) == {("GET", "/new"), ("PUT", "/new")}


@pytest.mark.parametrize("who", EVERYBODY)
def test_everybody_is_told_what_the_table_says_and_a_refusal_stores_nothing(
    stages: dict[Stage, Running], who: Who
) -> None:
    wrong = []
    for case in CASES:
        answer, has_changed = stages[case.stage].ask(case, who)
        expected = case.said[who]
        told = f"{answer.status_code}{'+' if has_changed else ''}"
        if " " in expected:
            told += f" {answer.headers.get('Location')}"
        if told != expected:
            wrong.append(f"{case.name} as {who}: {told}, not {expected}")
    assert wrong == []


@pytest.mark.parametrize("who", EVERYBODY)
def test_no_address_knows_another_method(stages: dict[Stage, Running], who: Who) -> None:
    running = stages["rating"]
    own: dict[str, set[str]] = {}
    for case in CASES:
        own.setdefault(case.rule, {"OPTIONS"}).update({case.method, "HEAD"} if case.method == "GET" else {case.method})
    client = running.client(who)
    headers = SAME_SITE | dict.fromkeys(("X-HTTP-Method-Override", "X-HTTP-Method", "X-Method-Override"), "POST")
    for address, rule in {filled(case.address, running.prepared.words): case.rule for case in CASES}.items():
        for method in sorted(set(METHODS) - own[rule]):
            answer = client.open(address, method=method, headers=headers, data={"_method": "POST"})
            # Another rule may know the address: `GET recruits.csv` is a file of the data that there is not.
            is_closed = answer.headers.get("Location") == "/researcher/sign-in" or answer.status_code == 403
            assert is_closed or answer.status_code in {404, 405}, (method, address)
    assert not running.has_changed()


@pytest.mark.parametrize("who", EVERYBODY)
def test_asking_what_is_allowed_or_for_headers_alone_stores_nothing(stages: dict[Stage, Running], who: Who) -> None:
    running = stages["rating"]
    for case in CASES:
        address = filled(case.address, running.prepared.words)
        if case.stage == "rating":
            for method in ("OPTIONS", "HEAD") if case.method == "GET" else ("OPTIONS",):
                answer = running.client(who).open(address, method=method, headers=SAME_SITE)
                assert answer.status_code in {200, 303, 401, 403, 404}, (method, address)
                assert method == "OPTIONS" or answer.data == b"", address
    assert not running.has_changed()


def test_a_case_can_be_wrong(stages: dict[Stage, Running]) -> None:
    """The control: what a table wrongly refuses or wrongly allows is found."""
    stranger = Case("POST", "/researcher/unblind", {"nobody": "403"})
    answer, has_changed = stages["rating"].ask(stranger, "nobody")
    assert (answer.status_code, has_changed) != (403, False)
    leaving = Case("POST", "/leave", {"A": "303"})
    assert stages["rating"].ask(leaving, "A")[1]


def test_the_folder_of_a_stage_is_never_written_to(stages: dict[Stage, Running], tmp_path: Path) -> None:
    """Otherwise one case would hide another."""
    case = next(case for case in CASES if case.method == "POST" and case.rule == "/leave")
    for _ in range(2):
        assert stages["rating"].ask(case, "A")[1]
    assert tmp_path.exists()
