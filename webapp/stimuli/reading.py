"""How much there is to read, and how long that takes: assumptions that every estimate names."""

import re
import unicodedata
from collections.abc import Iterable

WORDS_PER_MINUTE = 238
"""Silent reading of English non-fiction by adults (Brysbaert 2019, Journal of Memory and Language 109, 104047)."""

SECONDS_PER_PICTURE = 3.0
"""Ours: to look at one picture of three by three squares and compare it with the one before."""

CHARACTERS_PER_WORD = 2.0
"""Ours: of a script that sets no blanks between words, so many characters count as a word."""


def num_words(texts: Iterable[str]) -> float:
    """Count the words of some texts; kana and Chinese characters count as a part of a word each."""
    total = 0.0
    for text in texts:
        dense = sum(_is_dense(character) for character in text)
        rest = "".join(" " if _is_dense(character) else character for character in text)
        total += dense / CHARACTERS_PER_WORD + len(re.findall(r"\w[\w'\u2019-]*", rest))
    return total


def reading_seconds(words: float, pictures: float = 0.0) -> float:
    """Return how long it takes to read so many words and to look at so many pictures."""
    return words / WORDS_PER_MINUTE * 60 + pictures * SECONDS_PER_PICTURE


def _is_dense(character: str) -> bool:
    return unicodedata.name(character, "").startswith(("CJK UNIFIED", "HIRAGANA", "KATAKANA"))
