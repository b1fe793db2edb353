"""A data set that cannot be analysed, and how that is told."""

from collections.abc import Iterable, Sequence

MOST_TOLD = 20
"""How many problems of a file are told; the others are counted."""

_MAX_SHOWN = 60
"""How many characters of a wrong value a message repeats."""


class DataSetError(ValueError):
    """A data set that cannot be analysed.

    Attributes:
        problems: One line for each problem; of a file with many the first ones, and how many more there are.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


def first_of(problems: Sequence[str], file: str, num_all: int) -> tuple[str, ...]:
    """Return the problems that are told of a file, and how many more there are.

    Args:
        problems: At least the first ones.
        file: The file.
        num_all: How many there are in all.
    """
    told = tuple(problems[:MOST_TOLD])
    num_more = num_all - len(told)
    return (*told, f"{file}: and {num_more} more {'problem' if num_more == 1 else 'problems'}") if num_more else told


def shown(value: object) -> str:
    """Return a value as a message repeats it."""
    written = repr(value)
    return written if len(written) <= _MAX_SHOWN else written[: _MAX_SHOWN - 3] + "..."
