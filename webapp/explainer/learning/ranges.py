"""Which numbers a setting may be."""

import math


def check_number(name: str, value: object, *, whole: bool, may_be_zero: bool) -> None:
    """Refuse a setting that is no finite number above 0, or at least 0.

    Args:
        name: Of the setting, for the message.
        value: What it was set to.
        whole: Whether it must be a whole number.
        may_be_zero: Whether it may be 0.

    Raises:
        TypeError: It is no number, or no whole one.
        ValueError: It is out of range.
    """
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
        raise TypeError(f"{name} must be {'a whole number' if whole else 'a number'}, not {value!r}")
    if not math.isfinite(value) or value < 0 or (value == 0 and not may_be_zero):
        raise ValueError(f"{name} must be finite and {'at least 0' if may_be_zero else 'larger than 0'}, not {value!r}")
