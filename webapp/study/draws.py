"""Chance that can be repeated: every draw follows from one random word, which is written down."""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

_Option = TypeVar("_Option")


class Draws:
    """Numbers that follow from a word, one after the other.

    The i-th number, from 0, is the SHA-256 of the word and i, as an integer; of n options, each is chosen with a
    probability that differs from 1/n by less than n / 2^256.

    Attributes:
        word: At least 128 random bits, in hexadecimal, from the operating system.
    """

    def __init__(self, word: str) -> None:
        self.word = word
        self._num_drawn = 0

    def choice(self, seq: Sequence[_Option], /) -> _Option:
        """Return one of the options.

        Raises:
            IndexError: There is none.
        """
        return seq[self.randrange(len(seq))] if seq else seq[0]

    def randrange(self, stop: int, /) -> int:
        """Return a number from 0 to `stop` - 1.

        Raises:
            ValueError: There is no such number.
        """
        if stop < 1:
            raise ValueError(f"there must be something to draw from, not {stop} numbers")
        digest = hashlib.sha256(f"{self.word} {self._num_drawn}".encode()).digest()
        self._num_drawn += 1
        return int.from_bytes(digest) % stop
