"""What opens something cannot be guessed: at least 128 bits of the operating system's, and no two alike."""

import functools
import re
import secrets
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from flask import Flask

from tests.web.people import Visitor, hidden_nonce
from tests.web.researchers import researcher_of
from webapp.storage.participants import hash_token
from webapp.views.services import services_of
from webapp.views.tokens import page_nonce, participant_token, recruit_token

NUM = 1_000_000
MIN_BYTES = 16
SECRET = bytes(range(32))

DRAWN: dict[str, Callable[[int], str]] = {
    "nonce of a welcome page": lambda _: secrets.token_hex(16),
    "token of a session": lambda _: secrets.token_urlsafe(32),
    "token of a participant": lambda number: participant_token(SECRET, f"{number:032x}"),
    "token of somebody a recruiter sent": lambda number: recruit_token(
        SECRET, "live", "x", "prolific", f"{number:024x}"
    ),
    "nonce of a page": lambda number: page_nonce(SECRET, f"person {number // 40}", number % 40, 1),
}


class Draws:
    """Stands for `secrets`, and notes how many bytes each text was made of."""

    def __init__(self) -> None:
        self.num_bytes: dict[str, int] = {}

    def token_hex(self, num_bytes: int) -> str:
        return self._kept(_TOKEN_HEX(num_bytes), num_bytes)

    def token_urlsafe(self, num_bytes: int) -> str:
        return self._kept(_TOKEN_URLSAFE(num_bytes), num_bytes)

    def _kept(self, text: str, num_bytes: int) -> str:
        self.num_bytes[text] = num_bytes
        return text


_TOKEN_HEX, _TOKEN_URLSAFE = secrets.token_hex, secrets.token_urlsafe


@pytest.fixture
def draws(monkeypatch: pytest.MonkeyPatch) -> Draws:
    draws = Draws()
    monkeypatch.setattr(secrets, "token_hex", draws.token_hex)
    monkeypatch.setattr(secrets, "token_urlsafe", draws.token_urlsafe)
    return draws


def has_two_alike(texts: Iterable[str]) -> bool:
    """Tell whether two texts are the same; a million of them are kept as numbers of 64 bits."""
    kept = np.fromiter((hash(text) for text in texts), dtype=np.int64)
    return len(np.unique(kept)) < len(kept)


def test_whatever_a_browser_is_given_to_prove_itself_was_drawn_with_128_bits_at_least(app: Flask, draws: Draws) -> None:
    owner = researcher_of(app, "owner", "owner")
    given = [cookie_of(owner, "researcher"), cookie_of(owner, "browser").partition(".")[0]]
    visitor = Visitor(app)
    given.append(hidden_nonce(visitor.get("/")))
    visitor.agree()
    (code,) = {str(line["code"]) for line in owner.get("/researcher/people.json").get_json()["participants"]}
    link = owner.post(f"/researcher/people/{code}/link", {"reason": "They wrote to us"}).text
    given += re.findall(r"/resume/([\w-]+)", link)[:1]
    assert len(given) == 4
    assert [draws.num_bytes.get(text, 0) for text in given] == [32, 16, 16, 32]
    assert all(draws.num_bytes[text] >= MIN_BYTES for text in given)
    assert cookie_of(visitor, "participant") not in draws.num_bytes
    assert len(services_of(app).secret) >= 2 * MIN_BYTES, "what is computed from the key has no more bits than the key"


@pytest.mark.parametrize("name", DRAWN)
def test_of_a_million_no_two_are_alike(name: str) -> None:
    draw = DRAWN[name]
    assert not has_two_alike(draw(number) for number in range(NUM))


def test_two_alike_are_found_where_there_are_too_few_bits() -> None:
    """The control: of a million texts of 32 bits, a hundred and more are there twice."""
    assert has_two_alike(secrets.token_hex(4) for _ in range(NUM))


@pytest.mark.parametrize("name", DRAWN)
def test_every_bit_is_as_often_set_as_not_and_says_nothing_of_its_neighbour(name: str) -> None:
    assert worst_z(DRAWN[name](number) for number in range(20_000)) < 6


def test_a_bit_that_follows_another_is_found() -> None:
    """The controls: a counter, and bytes that are letters."""
    assert worst_z(f"{number:032x}" for number in range(20_000)) > 6
    assert worst_z(secrets.token_hex(8).encode().hex() for _ in range(20_000)) > 6


def test_what_is_stored_of_a_token_is_another_text_of_256_bits() -> None:
    token = secrets.token_urlsafe(32)
    assert re.fullmatch(r"[0-9a-f]{64}", hash_token(token))
    assert hash_token(token) != hash_token(token + "x")


def worst_z(texts: Iterable[str]) -> float:
    """Return by how many standard deviations the most unusual bit, or pair of neighbours, is off one half."""
    bits = np.unpackbits(np.array([_bytes_of(text) for text in texts], dtype=np.uint8), axis=1)
    pairs = bits[:, 1:] ^ bits[:, :-1]
    shares = np.concatenate([bits.mean(axis=0), pairs.mean(axis=0)])
    return float(np.abs(shares - 0.5).max() * 2 * np.sqrt(len(bits)))


def _bytes_of(text: str) -> list[int]:
    if re.fullmatch(r"[0-9a-f]+", text):
        return list(bytes.fromhex(text))
    values = [_BASE64.index(letter) for letter in text[:40]]
    number = functools.reduce(lambda whole, value: (whole << 6) | value, values, 0)
    return list(number.to_bytes(30, "big"))


_BASE64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"


def cookie_of(visitor: Visitor, name: str) -> str:
    cookie = visitor.client.get_cookie(name)
    assert cookie is not None
    return cookie.value
