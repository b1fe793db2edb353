"""How the dashboard says things and where its marks stand."""

import pytest

from webapp.storage.live_numbers import DropOutTest
from webapp.storage.records import Action
from webapp.study.quality import Flag
from webapp.views.researcher.charts import GAINS, SHARES, scale_axis, time_axis
from webapp.views.researcher.log_pages import GROUP_NAMES, GROUPS
from webapp.views.researcher.sentences import sentence
from webapp.views.researcher.words import RULES, drop_out_words, flag_words, p_words, seconds_words


@pytest.mark.parametrize(
    ("test", "words"),
    [
        (
            DropOutTest("1", 3.1, 5, 0.684, "chi_square", None),
            "chi-square(5) = 3.1, p = .68: no sign of differential drop-out",
        ),
        (
            DropOutTest("1", 22.0, 5, 0.0004, "permutation", 0.0002),
            "permutation test of chi-square(5) = 22.0, p < .001: drop-out differs between the arms",
        ),
    ],
)
def test_a_test_of_drop_out_is_said_as_reports_say_it(test: DropOutTest, words: str) -> None:
    assert drop_out_words(test) == words


@pytest.mark.parametrize(
    ("value", "words"), [(1.0, "= 1.00"), (0.05, "= .05"), (0.004, "= .004"), (0.00099, "< .001"), (0.0, "< .001")]
)
def test_a_p_value_has_no_nought_before_its_point(value: float, words: str) -> None:
    assert p_words(value) == words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.04, "40 ms"),
        (0.9994, "999 ms"),
        (0.9996, "1.0 s"),
        (9.96, "10.0 s"),
        (12.4, "12 s"),
        (59.6, "1 min 00 s"),
        (65, "1 min 05 s"),
        (7800, "2 h 10 min"),
    ],
)
def test_a_duration_is_said_in_the_largest_fitting_units(seconds: float, words: str) -> None:
    assert seconds_words(seconds) == words


def test_a_flag_is_told_with_what_was_found_and_the_limit() -> None:
    assert flag_words(Flag("min_total_minutes", 2.44, 3.0)) == "too fast: 2.4, limit 3"
    assert flag_words(Flag("straight_lining", 3, None)) == "straight-lining: 3"
    assert flag_words(Flag("failed_quiz", None, None)) == RULES["failed_quiz"]


def test_a_value_beyond_an_axis_stands_at_its_end() -> None:
    assert [scale_axis(5).place(value) for value in (0.2, 1, 3, 5, 9)] == [
        "0.00%",
        "0.00%",
        "50.00%",
        "100.00%",
        "100.00%",
    ]
    assert GAINS.place(0) == SHARES.place(0.5) == "50.00%"
    assert scale_axis(5).width(0, 3) == "50.00%"


@pytest.mark.parametrize("largest", [0.0, 0.4, 7.0, 95.0, 4000.0, 10_000_000.0])
def test_an_axis_of_times_holds_every_value_between_few_marks(largest: float) -> None:
    axis = time_axis([0.1, largest])
    assert axis.highest >= largest
    assert axis.ticks[0] == 0
    assert axis.ticks[-1] == axis.highest
    assert len(axis.ticks) <= 8 or largest > 6 * 86400


def test_every_kind_of_record_has_a_sentence_even_after_its_content_was_erased() -> None:
    every = {action for actions in GROUPS.values() for action in actions}
    assert set(GROUPS) == set(GROUP_NAMES)
    assert every == set(Action.__args__)  # type: ignore[attr-defined]
    for action in every:
        assert sentence(action, 3, 1, {})


def test_a_sentence_counts_and_names_as_people_do() -> None:
    ended = {"account": "olga", "ended": 1}
    assert sentence("sessions_revoked", None, None, ended) == "ended 1 session of olga"
    assert sentence("sessions_revoked", None, None, ended | {"ended": 3}) == "ended 3 sessions of olga"
    assert sentence("page_released", None, None, {}) == "released a page"
    assert sentence("page_restarted", 4, 1, {}) == "let page 4 begin anew"


def test_a_correction_of_a_trial_tells_neither_question_nor_value_to_whoever_is_blind() -> None:
    told = {"file": "ratings", "question": "loveliness", "from": "2", "to": "4", "reason": "Typed wrong"}
    assert sentence("corrected", 5, None, told, sees=False) == "corrected a value on page 5: “Typed wrong”"
    assert "loveliness on page 5 from “2” to “4”" in sentence("corrected", 5, None, told)
    assert "loveliness" in sentence("corrected", 5, None, told | {"file": "answers"}, sees=False)


def test_what_was_typed_is_never_taken_for_a_pattern() -> None:
    assert sentence("noted", None, None, {"text": "{page} {0} %s"}) == "noted: “{page} {0} %s”"
