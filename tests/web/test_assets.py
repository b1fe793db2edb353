"""Styles and scripts are kept by browsers for good, under addresses that change with them; texts travel packed."""

import gzip
import re
from pathlib import Path

import pytest
from flask import Flask, url_for
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import ROOT
from webapp.views.assets import digest_of

STATIC = ROOT / "static"
FILES = sorted(path.relative_to(STATIC).as_posix() for path in STATIC.rglob("*") if path.is_file())
FOLDERS = st.dictionaries(st.text("ab/", max_size=3), st.binary(max_size=3), max_size=3)


def address(app: Flask, name: str) -> str:
    with app.test_request_context():
        return url_for("static", filename=name)


@given(FOLDERS, FOLDERS)
def test_two_folders_have_the_same_address_only_if_every_file_is_the_same(
    one: dict[str, bytes], other: dict[str, bytes]
) -> None:
    assert (digest_of(one) == digest_of(other)) == (one == other)


@pytest.mark.parametrize("name", ["js/participant.js", "css/base.css", "favicon.svg", "favicon.ico"])
@pytest.mark.parametrize("accepted", ["gzip, br", "identity", "gzip;q=0", ""])
def test_a_file_arrives_whole_and_is_kept_for_good(app: Flask, name: str, accepted: str) -> None:
    answer = app.test_client().get(address(app, name), headers={"Accept-Encoding": accepted})
    is_packed = accepted.startswith("gzip,") and name != "favicon.ico" and (STATIC / name).stat().st_size >= 600
    assert answer.headers.get("Content-Encoding") == ("gzip" if is_packed else None)
    content = gzip.decompress(answer.data) if is_packed else answer.data
    assert content == (STATIC / name).read_bytes()
    assert answer.headers["Cache-Control"] == "public, max-age=31536000, immutable"
    assert answer.headers["Content-Length"] == str(len(answer.data))


@pytest.mark.parametrize("name", FILES)
def test_every_file_has_a_type_that_browsers_accept(app: Flask, name: str) -> None:
    expected = {".css": "text/css", ".js": r"(text|application)/javascript", ".svg": r"image/svg\+xml"}
    answer = app.test_client().get(address(app, name))
    assert re.fullmatch(expected.get(Path(name).suffix, ".+"), str(answer.mimetype))


@pytest.mark.parametrize("name", ["../webapp/app.py", "js", "js/none.js", ""])
def test_nothing_else_is_sent(app: Flask, name: str) -> None:
    answer = app.test_client().get(address(app, "js/participant.js").replace("js/participant.js", name))
    assert answer.status_code == 404
    assert answer.headers["Cache-Control"] == "no-store"


def test_an_address_of_another_release_leads_nowhere(app: Flask) -> None:
    assert app.test_client().get("/static/0123456789ab/js/participant.js").status_code == 404


def test_a_page_travels_packed_to_whoever_can_unpack_it(app: Flask) -> None:
    client = app.test_client()
    plain, packed = (client.get("/declined", headers={"Accept-Encoding": name}) for name in ("identity", "gzip"))
    assert packed.headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(packed.data) == plain.data
    assert len(packed.data) < len(plain.data) / 2
    for answer in (plain, packed):
        assert {"Accept-Encoding", "Cookie"} <= set(re.split(r",\s*", answer.headers["Vary"]))
        assert answer.headers["Cache-Control"] == "no-store"
