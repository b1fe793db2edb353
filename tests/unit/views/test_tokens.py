import itertools
import re

from webapp.views.tokens import page_nonce, participant_token, recruit_token, same, session_key

ONE, OTHER = b"1" * 32, b"2" * 32


def test_tokens_differ_by_secret_purpose_person_and_page() -> None:
    tokens = [session_key(secret) for secret in (ONE, OTHER)]
    tokens += [participant_token(secret, nonce) for secret in (ONE, OTHER) for nonce in ("a", "b")]
    tokens += [
        page_nonce(secret, person, page, attempt)
        for secret in (ONE, OTHER)
        for person in "ab"
        for page in range(1, 12)
        for attempt in (1, 2)
    ]
    tokens += [recruit_token(secret, "live", "study", "prolific", person) for secret in (ONE, OTHER) for person in "ab"]
    assert len(set(tokens)) == len(tokens)
    assert not [pair for pair in itertools.permutations(tokens, 2) if pair[0].startswith(pair[1])]


def test_tokens_are_stable_and_long_enough() -> None:
    assert participant_token(ONE, "a") == participant_token(ONE, "a")
    assert re.fullmatch(r"[0-9a-f]{64}", participant_token(ONE, "a"))
    assert re.fullmatch(r"[0-9a-f]{32}", page_nonce(ONE, "person", 3, 1))


def test_comparing_works_for_any_text() -> None:
    assert same("ü", "ü")
    assert not same("ü", "u")
    assert not same("", "a")
