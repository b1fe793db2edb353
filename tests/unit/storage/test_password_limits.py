"""Where exactly a password begins to be good enough; `bqmwv` and the like are letters that no list has together."""

import re

import pytest

from webapp.storage.passwords import WeakPasswordError, check_password, is_easy


@pytest.mark.parametrize("length", [12, 13, 1023, 1024])
def test_a_password_has_twelve_to_1024_characters(length: int) -> None:
    check_password("bqmwvkzbqmwv"[: min(length, 12)].ljust(length, "b"), "somebody")


@pytest.mark.parametrize(
    ("length", "said"),
    [
        (0, "a password needs at least 12 characters, not 0"),
        (11, "a password needs at least 12 characters, not 11"),
        (1025, "a password has at most 1,024 characters, not 1,025"),
    ],
)
def test_any_other_length_is_refused_with_the_limit_that_it_is_beyond(length: int, said: str) -> None:
    with pytest.raises(WeakPasswordError, match=f"^{said}$"):
        check_password("bqmwvkzbqmw"[: min(length, 11)].ljust(length, "b"), "somebody")


def test_an_easy_one_is_refused_with_what_to_do() -> None:
    said = (
        "the password consists of what is tried first, such as common words and runs; "
        "use several words that have nothing to do with each other"
    )
    with pytest.raises(WeakPasswordError, match=f"^{re.escape(said)}$"):
        check_password("passwordpassword", "somebody")


def test_five_different_characters_have_to_be_left_and_four_are_too_few() -> None:
    assert is_easy("bqmwasdfghjkl", "x")
    assert not is_easy("bqmwvasdfghjkl", "x")


def test_a_run_of_three_keys_counts_for_nothing_and_two_are_no_run() -> None:
    assert is_easy("bqmwasdbqmwasd", "x")
    assert is_easy("bqmwdsabqmwdsa", "x")
    assert not is_easy("opklnmyzopkl", "x")
    assert not is_easy("zplm9zplm9zp", "x")


def test_a_year_counts_for_nothing_and_another_number_does() -> None:
    assert is_easy("bqmw1974bqmw2038", "x")
    assert not is_easy("bqmw2174bqmw2138", "x")


def test_the_longest_word_is_taken_out_first_so_that_no_rest_of_it_counts() -> None:
    assert is_easy("bqmwlovekzd1", "bqmwlovekzd")
    assert not is_easy("bqmwlovekzd1", "another")
