from collections import Counter

from webapp.bots.mix import parse_mix
from webapp.bots.plan import make_plan

SHARES = parse_mix("attentive=3,drop-out=1")


def test_a_seed_decides_everything() -> None:
    assert make_plan(SHARES, 20, ("en", "ja"), 5) == make_plan(SHARES, 20, ("en", "ja"), 5)
    assert make_plan(SHARES, 20, ("en", "ja"), 5) != make_plan(SHARES, 20, ("en", "ja"), 6)


def test_what_a_bot_draws_for_one_page_does_not_depend_on_other_pages() -> None:
    bot, again = make_plan(SHARES, 2, ("en",), 5)[0], make_plan(SHARES, 2, ("en",), 5)[0]
    bot.stream("page", 1).random()
    assert bot.stream("page", 2).random() == again.stream("page", 2).random()
    assert bot.stream("page", 1).random() != bot.stream("page", 2).random()


def test_behaviours_come_in_the_declared_numbers_and_in_no_order() -> None:
    names = [bot.behaviour.name for bot in make_plan(SHARES, 40, ("en",), 0)]
    assert Counter(names) == {"attentive": 30, "drop-out": 10}
    assert names != sorted(names)


def test_languages_are_taken_in_turn() -> None:
    assert [bot.language for bot in make_plan(SHARES, 3, ("en", "ja"), 0)] == ["en", "ja", "en"]


def test_those_who_leave_do_so_on_different_pages_and_in_both_ways() -> None:
    leaving = make_plan(parse_mix("drop-out=1"), 40, ("en",), 0)
    assert len({int(bot.leaves_after * 11) for bot in leaving}) > 5
    assert {bot.says_goodbye for bot in leaving} == {True, False}
