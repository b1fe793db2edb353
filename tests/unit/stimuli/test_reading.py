import pytest

from webapp.stimuli.reading import SECONDS_PER_PICTURE, num_words, reading_seconds


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", 0),
        ("Go on", 2),
        ("The agent's way - all of it!", 6),
        ("three-by-three squares", 2),
        ("前へ進む", 2.0),
        ("ゴールまで 3 steps", 4.5),
    ],
)
def test_words_are_counted_in_scripts_with_and_without_blanks(text: str, expected: float) -> None:
    assert num_words([text]) == expected


def test_several_texts_are_counted_together() -> None:
    assert num_words(["Go on", "turn left"]) == 4


def test_238_words_take_a_minute_and_pictures_come_on_top() -> None:
    assert reading_seconds(238) == 60
    assert reading_seconds(119, 2) == 30 + 2 * SECONDS_PER_PICTURE
