import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.protocol import Item
from webapp.study.questionnaire import (
    MAX_RESPONSE_TIME_MS,
    RatingProblem,
    Ratings,
    parse_ratings,
    rating_field,
    time_field,
)

ITEMS = tuple(Item(id=name) for name in ("likeliness", "loveliness", "general"))
WHOLE = {"rating-likeliness": "4", "rating-loveliness": "1", "rating-general": "5"}


def test_a_whole_form_gives_every_rating() -> None:
    times = {"time-likeliness": "2100", "time-loveliness": "0", "time-general": ""}
    assert parse_ratings({**WHOLE, **times, "nonce": "x"}, ITEMS) == Ratings(
        values={"likeliness": 4, "loveliness": 1, "general": 5},
        response_times={"likeliness": 2100, "loveliness": 0, "general": None},
    )


def test_a_form_without_scripts_has_no_response_times() -> None:
    ratings = parse_ratings(WHOLE, ITEMS)
    assert isinstance(ratings, Ratings)
    assert set(ratings.response_times.values()) == {None}


@pytest.mark.parametrize("left_out", [0, 1, 2])
def test_a_missing_answer_is_named(left_out: int) -> None:
    item = ITEMS[left_out].id
    form = {name: value for name, value in WHOLE.items() if name != rating_field(item)}
    assert parse_ratings(form, ITEMS) == (RatingProblem(item, "missing"),)


def test_an_empty_form_names_every_item_in_order() -> None:
    assert parse_ratings({}, ITEMS) == tuple(RatingProblem(item.id, "missing") for item in ITEMS)


@pytest.mark.parametrize("value", ["0", "6", "-1", "2.5", "three", "٣", "1e0", "5" * 5000, "1 2"])
def test_what_is_no_point_of_the_scale_is_invalid(value: str) -> None:
    assert parse_ratings({**WHOLE, "rating-general": value}, ITEMS) == (RatingProblem("general", "invalid"),)


@given(points=st.integers(2, 11), value=st.integers(-3, 20))
def test_exactly_the_points_of_the_scale_are_taken(points: int, value: int) -> None:
    parsed = parse_ratings({"rating-a": str(value)}, [Item(id="a", points=points)])
    assert isinstance(parsed, Ratings) == (1 <= value <= points)


@given(time=st.text(max_size=12))
def test_no_rating_is_lost_for_a_strange_response_time(time: str) -> None:
    ratings = parse_ratings({**WHOLE, time_field("general"): time}, ITEMS)
    assert isinstance(ratings, Ratings)
    measured = ratings.response_times["general"]
    assert measured is None or 0 <= measured <= MAX_RESPONSE_TIME_MS


@given(time=st.integers(0, 2**33))
def test_a_response_time_is_kept_exactly_unless_it_is_too_long_to_be_one(time: int) -> None:
    ratings = parse_ratings({**WHOLE, time_field("general"): str(time)}, ITEMS)
    assert isinstance(ratings, Ratings)
    assert ratings.response_times["general"] == (time if time <= MAX_RESPONSE_TIME_MS else None)
