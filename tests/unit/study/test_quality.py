from dataclasses import replace

import pytest

from webapp.study.quality import RULES, Flag, PersonFacts, declared_rules, judge, judged_rules, rule_words
from webapp.study.sections import Quality

ALL = Quality(
    min_total_minutes=3.0,
    min_seconds_per_rating_page=3.0,
    straight_lining=True,
    failed_attention_checks=2,
    failed_quiz=True,
    duplicates=True,
    incomplete=True,
)
GOOD = PersonFacts(
    total_s=600,
    rating_page_s=(8, 9, 10),
    num_rating_pages=3,
    num_items=3,
    ratings=frozenset({2, 3}),
    num_checks=2,
    num_failed_checks=1,
    failed_quiz=False,
    is_duplicate=False,
    is_complete=True,
)
BAD = {
    "min_total_minutes": ({"total_s": 90}, 1.5, 3.0),
    "min_seconds_per_rating_page": ({"rating_page_s": (1, 2.5, 80)}, 2.5, 3.0),
    "straight_lining": ({"ratings": frozenset({4})}, 4, None),
    "failed_attention_checks": ({"num_failed_checks": 2}, 2, 2),
    "failed_quiz": ({"failed_quiz": True}, None, None),
    "duplicates": ({"is_duplicate": True}, None, None),
    "incomplete": ({"total_s": None, "is_complete": False}, None, None),
}


def test_there_is_a_rule_for_each_setting_of_the_section_in_its_order() -> None:
    assert list(RULES) == list(Quality.model_fields)
    assert declared_rules(ALL) == RULES
    assert declared_rules(Quality()) == ()


def test_whoever_keeps_to_everything_is_judged_by_all_rules_and_flagged_by_none() -> None:
    assert judge(ALL, GOOD) == ()
    assert judged_rules(ALL, GOOD) == RULES


@pytest.mark.parametrize("rule", RULES)
def test_each_rule_flags_what_it_is_about_and_nothing_else(rule: str) -> None:
    changes, value, limit = BAD[rule]
    facts = replace(GOOD, **changes)  # type: ignore[arg-type]
    assert [(flag.rule, flag.value, flag.limit) for flag in judge(ALL, facts)] == [(rule, value, limit)]
    assert judge(Quality(), facts) == ()


def test_limits_themselves_are_no_offence_but_so_many_failed_checks_are() -> None:
    at_limit = replace(GOOD, total_s=180, rating_page_s=(3,))
    assert judge(ALL, at_limit) == ()
    strict = Quality(failed_attention_checks=1)
    assert judge(strict, GOOD) == (Flag("failed_attention_checks", 1, 1),)


@pytest.mark.parametrize("changes", [{"num_rating_pages": 1}, {"num_items": 1}])
def test_one_page_or_one_item_is_no_straight_line(changes: dict[str, int]) -> None:
    facts = replace(GOOD, ratings=frozenset({4}), **changes)  # type: ignore[arg-type]
    assert judge(ALL, facts) == ()
    assert "straight_lining" not in judged_rules(ALL, facts)


def test_nobody_is_judged_by_what_is_not_known_yet() -> None:
    assert judge(ALL, PersonFacts()) == ()
    assert judged_rules(ALL, PersonFacts()) == ()
    left = PersonFacts(is_complete=False)
    assert judged_rules(ALL, left) == ("incomplete",)
    assert judge(ALL, left) == (Flag("incomplete", None, None),)


def test_rules_read_with_their_limits() -> None:
    words = [rule_words(ALL, rule) for rule in RULES]
    assert words[0] == "finished the study in less than 3 min"
    assert words[3] == "failed attention checks: 2 or more"
    assert len(set(words)) == len(RULES)


def test_facts_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="of 1 attention checks, 2 cannot have failed"):
        PersonFacts(num_checks=1, num_failed_checks=2)
    with pytest.raises(ValueError, match=r"this is 12\.5 s"):
        PersonFacts(total_s=12.5)
