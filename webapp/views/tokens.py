"""Secrets that are computed instead of stored: each is an HMAC-SHA256 under the instance's secret key."""

import hashlib
import hmac


def session_key(secret: bytes) -> str:
    """Return the key with which Flask signs its own cookie."""
    return _hmac(secret, "session")


def participant_token(secret: bytes, consent_nonce: str) -> str:
    """Return the 256-bit cookie token of whoever agrees on a welcome page.

    It follows from the page's nonce, so that the same form sent twice enrols once; without the secret key the nonce
    says nothing about it.
    """
    return _hmac(secret, "participant", consent_nonce)


def recruit_token(secret: bytes, mode: str, study: str, *identity: str) -> str:
    """Return the 256-bit cookie token of somebody whom a recruiter sent.

    It follows from the recruiter's link, so that the same link leads back to the same place on every device.
    """
    return _hmac(secret, "recruit", mode, study, *identity)


def page_nonce(secret: bytes, token_hash: str, number: int, attempt: int, restart: int = 0) -> str:
    """Return the nonce of one attempt at one page for one participant: 128 bits, in hexadecimal.

    A page that was begun anew has others, so that a window which is open from before cannot act in its place.
    """
    again = () if restart == 0 else (str(restart),)
    return _hmac(secret, "page", token_hash, str(number), str(attempt), *again)[:32]


def bot_pass(secret: bytes) -> str:
    """Return what a program shows to take part as a bot: only who can read the instance's secret key can know it."""
    return _hmac(secret, "bots")


def browser_mark(secret: bytes, account: str, browser: str) -> str:
    """Return what shows that somebody signed in to an account from a browser before."""
    return _hmac(secret, "browser", browser, account)


def same(one: str, other: str) -> bool:
    """Compare two secrets in a time that does not depend on what they share."""
    return hmac.compare_digest(one.encode(), other.encode())


def _hmac(secret: bytes, purpose: str, *parts: str) -> str:
    return hmac.new(secret, "|".join((purpose, *parts)).encode(), hashlib.sha256).hexdigest()
