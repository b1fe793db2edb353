"""Tokens and nonces are these for ever: links that were given away and pages that are open outlast a new version."""

import hashlib
import hmac

from webapp.views.tokens import (
    bot_pass,
    browser_mark,
    page_nonce,
    participant_token,
    recruit_token,
    same,
    session_key,
)

SECRET = bytes(range(32))


def of(text: str) -> str:
    return hmac.new(SECRET, text.encode(), hashlib.sha256).hexdigest()


def test_a_token_is_the_hmac_of_its_purpose_and_its_parts() -> None:
    assert session_key(SECRET) == of("session")
    assert participant_token(SECRET, "Nonce") == of("participant|Nonce")
    assert recruit_token(SECRET, "live", "study", "prolific", "Id") == of("recruit|live|study|prolific|Id")
    assert bot_pass(SECRET) == of("bots")
    assert browser_mark(SECRET, "Somebody", "browser") == of("browser|browser|Somebody")


def test_a_nonce_is_the_first_half_and_names_a_restart_only_if_there_was_one() -> None:
    assert page_nonce(SECRET, "hash", 3, 1) == page_nonce(SECRET, "hash", 3, 1, 0) == of("page|hash|3|1")[:32]
    assert page_nonce(SECRET, "hash", 3, 2, 1) == of("page|hash|3|2|1")[:32]


def test_secrets_are_the_same_only_if_all_of_them_is() -> None:
    assert same("", "")
    assert same("abc", "abc")
    assert not same("abc", "abd")
    assert not same("abc", "ab")
