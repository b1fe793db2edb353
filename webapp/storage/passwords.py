"""Which passwords are too easy to guess: what is left of them without common words and runs of keys must be something.

Lists of the most common passwords hold few of twelve characters, and those are made of the same parts over and over:
a common word twice, with digits or with the row of keys beside it. So the parts are taken away instead.
"""

import re

MIN_LENGTH = 12
MAX_LENGTH = 1024
_MIN_DISTINCT = 5

CONTEXT_WORDS = (
    "xar",
    "sakai",
    "sakai2021",
    "researcher",
    "experiment",
    "explanation",
    "participant",
    "prolific",
    "dashboard",
)
"""What somebody would try who knows what the account is for; the account's own name is one of them."""

_COMMON_WORDS = (
    *("password", "passwort", "passwd", "contrasena", "motdepasse", "letmein", "welcome", "iloveyou", "loveyou"),
    *("secret", "admin", "administrator", "root", "user", "guest", "login", "test", "testing", "default"),
    *("changeme", "master", "monkey", "dragon", "football", "baseball", "soccer", "hockey", "princess"),
    *("sunshine", "shadow", "superman", "batman", "starwars", "pokemon", "michael", "jennifer", "jordan"),
    *("ashley", "charlie", "daniel", "jessica", "thomas", "hunter", "killer", "ranger", "trustno", "whatever"),
    *("freedom", "computer", "internet", "samsung", "google", "hello", "summer", "winter", "spring", "autumn"),
    *("january", "monday", "friday", "university", "chocolate", "butterfly", "liverpool", "chelsea", "arsenal"),
    *("mustang", "harley", "corvette", "qwerty", "azerty", "qwertz", "love", "fuck", "baby"),
)
_ROWS = (
    *("abcdefghijklmnopqrstuvwxyz", "01234567890123456789", "qwertyuiop", "asdfghjkl", "zxcvbnm", "qwertzuiop"),
    *("azertyuiop", "1qaz2wsx3edc4rfv5tgb6yhn7ujm8ik9ol", "1q2w3e4r5t6y7u8i9o0p", "qazwsxedcrfvtgbyhnujm"),
    *("!@#$%^&*()"),
)
_MIN_RUN = 3
_LETTERS = str.maketrans("013457$@!", "oieastsai")


class WeakPasswordError(ValueError):
    """A password that cannot be used; the message says why."""


def check_password(password: str, name: str) -> None:
    """Make sure that a password can be that of an account of some name.

    Any characters may be in it, and it is taken as it is.

    Raises:
        WeakPasswordError: It is too short, too long, or consists of what is tried first.
    """
    if len(password) < MIN_LENGTH:
        raise WeakPasswordError(f"a password needs at least {MIN_LENGTH} characters, not {len(password)}")
    if len(password) > MAX_LENGTH:
        raise WeakPasswordError(f"a password has at most {MAX_LENGTH:,} characters, not {len(password):,}")
    if is_easy(password, name):
        wish = "use several words that have nothing to do with each other"
        raise WeakPasswordError(f"the password consists of what is tried first, such as common words and runs; {wish}")


def is_easy(password: str, name: str) -> bool:
    """Tell whether fewer than five different characters are left without common words, the name and runs of keys."""
    said = password.casefold()
    return any(
        len(set(_rest(writing, name.casefold()))) < _MIN_DISTINCT for writing in (said, said.translate(_LETTERS))
    )


def _rest(said: str, name: str) -> str:
    words = sorted({*CONTEXT_WORDS, *_COMMON_WORDS, *re.findall(r"\w{3,}", name)}, key=len, reverse=True)
    for word in words:
        said = said.replace(word, "")
    for row in (*_ROWS, *(row[::-1] for row in _ROWS)):
        for length in range(len(row), _MIN_RUN - 1, -1):
            for start in range(len(row) - length + 1):
                said = said.replace(row[start : start + length], "")
    return re.sub(r"(19|20)\d\d", "", said)
