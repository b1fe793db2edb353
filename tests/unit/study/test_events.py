import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.answers import Event
from webapp.study.events import BEHAVIOUR_EVENTS, EVENTS, MAX_EVENTS, TIMING_EVENTS, parse_events
from webapp.study.questionnaire import MAX_RESPONSE_TIME_MS

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=70) | st.sampled_from(sorted(EVENTS)),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=30,
)


def test_a_log_is_read_in_its_order() -> None:
    text = '[["painted", "", "", 0], ["changed", "rating-general", "4", 1500], ["focus_lost", "", "", 1400]]'
    assert parse_events(text, behaviour=False) == (
        Event("painted", "", "", 0),
        Event("changed", "rating-general", "4", 1500),
        Event("focus_lost", "", "", 1400),
    )


def test_a_browser_without_scripts_sends_no_log() -> None:
    assert parse_events("", behaviour=True) == ()


@pytest.mark.parametrize("name", sorted(BEHAVIOUR_EVENTS))
def test_how_pictures_are_looked_at_is_only_kept_where_the_study_says_so(name: str) -> None:
    text = json.dumps([["painted", "", "", 0], [name, "1", "5", 10]])
    assert [event.name for event in parse_events(text, behaviour=True)] == ["painted", name]
    assert [event.name for event in parse_events(text, behaviour=False)] == ["painted"]


@pytest.mark.parametrize("name", sorted(TIMING_EVENTS))
def test_how_long_things_took_is_always_kept(name: str) -> None:
    text = json.dumps([[name, "1", "5", 10]])
    assert parse_events(text, behaviour=True) == parse_events(text, behaviour=False) == (Event(name, "1", "5", 10),)


@pytest.mark.parametrize(
    "entry",
    [
        ["drive_action", "1", "left", 10],
        ["Painted", "", "", 10],
        [None, "", "", 10],
        [["painted"], "", "", 10],
        ["painted", "", "", -1],
        ["painted", "", "", MAX_RESPONSE_TIME_MS + 1],
        ["painted", "", "", 1.5],
        ["painted", "", "", "10"],
        ["painted", "", "", True],
        ["painted", "", "", None],
        ["painted", "", 10],
        ["painted", "", "", 10, ""],
        {"painted": 10},
        "painted",
        10,
        None,
    ],
)
def test_an_entry_that_makes_no_sense_is_left_out_and_the_rest_is_kept(entry: object) -> None:
    text = json.dumps([["focus_lost", "", "", 5], entry, ["focus_regained", "", "", 6]])
    assert [event.name for event in parse_events(text, behaviour=True)] == ["focus_lost", "focus_regained"]


@pytest.mark.parametrize("text", ["{}", "null", "3", '"painted"', "[", "painted", "[" * 100_000, '[["painted"'])
def test_what_is_no_list_is_no_log(text: str) -> None:
    assert parse_events(text, behaviour=True) == ()


def test_of_a_log_that_is_too_long_the_beginning_is_kept() -> None:
    text = json.dumps([["changed", str(number), "", number] for number in range(MAX_EVENTS + 100)])
    kept = parse_events(text, behaviour=True)
    assert [event.at_ms for event in kept] == list(range(MAX_EVENTS))


def test_what_is_left_out_takes_no_place_of_what_is_kept() -> None:
    entries = [["nonsense", "", "", 0]] * 1000 + [["painted", "", "", number] for number in range(MAX_EVENTS)]
    assert len(parse_events(json.dumps(entries), behaviour=True)) == MAX_EVENTS


def test_targets_and_values_are_short_printable_text() -> None:
    text = json.dumps([["changed", "a\nb\x00c", "x" * 1000, 1], ["changed", 3, None, 2], ["changed", "日本", 2.5, 3]])
    assert parse_events(text, behaviour=False) == (
        Event("changed", "abc", "x" * 64, 1),
        Event("changed", "3", "", 2),
        Event("changed", "日本", "2.5", 3),
    )


@given(text=st.text() | ANYTHING.map(json.dumps), behaviour=st.booleans())
def test_nothing_that_a_browser_may_send_fails(text: str, behaviour: bool) -> None:
    for event in parse_events(text, behaviour=behaviour):
        assert event.name in (EVENTS if behaviour else TIMING_EVENTS)
        assert 0 <= event.at_ms <= MAX_RESPONSE_TIME_MS
        for part in (event.target, event.value):
            assert len(part) <= 64
            assert part.isprintable()


@given(
    entries=st.lists(
        st.tuples(
            st.sampled_from(sorted(TIMING_EVENTS)),
            st.text(st.characters(categories=("L", "N")), max_size=64),
            st.text(st.characters(categories=("L", "N")), max_size=64),
            st.integers(0, MAX_RESPONSE_TIME_MS),
        ),
        max_size=20,
    )
)
def test_a_log_that_makes_sense_is_kept_whole(entries: list[tuple[str, str, str, int]]) -> None:
    assert parse_events(json.dumps(entries), behaviour=False) == tuple(Event(*entry) for entry in entries)
