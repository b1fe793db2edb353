"""Passwords: any long one may be used that is not among the first to be tried."""

import pytest
from flask import Flask
from hypothesis import given
from hypothesis import strategies as st

from tests.web.researchers import LONG_AGO, PASSWORD
from webapp.storage.accounts import AccountError, change_password, create_researcher
from webapp.storage.passwords import CONTEXT_WORDS, MAX_LENGTH, WeakPasswordError, check_password, is_easy
from webapp.views.services import services_of

EASY = (
    "password1234",
    "passwordpassword",
    "P@ssw0rd2031!",
    "qwertyuiop123",
    "1qaz2wsx3edc",
    "123456789012",
    "aaaaaaaaaaaa",
    "iloveyou1234",
    "adminadmin123",
    "letmeinletmein",
    "abcdefghijkl",
    "zxcvbnm,./zxcvbnm",
    "Welcome2031!!",
    "monkeydragon1",
    "sakai2021sakai",
    "ResearcherXAR1",
    "ada.lovelace1",
    "lovelace2031ada",
    "qazwsxedcrfv",
    "987654321098",
    "football1234",
)
GOOD = (
    PASSWORD,
    "a password of several odd parts",
    "kettle umbrella tuesday",
    "x9!Qv#2mLp@7",
    "ひらがなカタカナ漢字かなまじり",
    "my dragon eats purple fog",
    "  blanks at both ends  ",
)


@pytest.mark.parametrize("password", EASY)
def test_what_is_tried_first_is_refused(password: str) -> None:
    assert len(password) >= 12
    with pytest.raises(WeakPasswordError, match="tried first"):
        check_password(password, "ada.lovelace")


@pytest.mark.parametrize("password", GOOD)
def test_any_other_characters_may_be_used(password: str) -> None:
    check_password(password, "ada.lovelace")


@given(
    st.text(st.characters(categories=("Lo", "P")), min_size=64, max_size=MAX_LENGTH).filter(
        lambda text: len(set(text)) > 9
    )
)
def test_long_ones_of_any_composition_may_be_used(password: str) -> None:
    check_password(password, "ada.lovelace")


@pytest.mark.parametrize("word", CONTEXT_WORDS)
def test_words_of_the_study_are_no_passwords(word: str) -> None:
    assert is_easy(word * 4, "somebody")


def test_an_easy_one_makes_no_account_and_changes_none(app: Flask) -> None:
    database = services_of(app).database
    with pytest.raises(AccountError, match="tried first"):
        create_researcher(database, "ada", "passwordpassword", LONG_AGO)
    create_researcher(database, "ada", PASSWORD, LONG_AGO)
    with pytest.raises(AccountError, match="tried first"):
        change_password(database, "ada", "passwordpassword", "command line", LONG_AGO)
