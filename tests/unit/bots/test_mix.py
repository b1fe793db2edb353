import pytest

from webapp.bots.behaviours import BEHAVIOURS
from webapp.bots.errors import BotError
from webapp.bots.mix import allot, parse_mix


def test_shares_and_counts_mean_the_same() -> None:
    assert (
        parse_mix("attentive=0.75, random=0.25")
        == parse_mix("attentive=6,random=2")
        == {
            "attentive": 0.75,
            "random": 0.25,
        }
    )


def test_every_behaviour_can_be_named() -> None:
    assert set(parse_mix(",".join(f"{name}=1" for name in BEHAVIOURS))) == set(BEHAVIOURS)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("attentiv=1", "--mix names 'attentiv'; did you mean 'attentive'?"),
        ("human=1", "--mix names 'human'; the behaviours are attentive, straight-liner,"),
        ("random=0", "--mix gives 'random' the share '0'; use a number above 0"),
        ("random=-1", "--mix gives 'random' the share '-1'; use a number above 0"),
        ("random=nan", "use a number above 0"),
        ("random=many", "use a number above 0"),
        ("random=inf", "use a number above 0"),
        ("random", "--mix holds 'random'; write name=share"),
        ("random=1,,", "--mix holds ''; write name=share"),
        ("random=1,random=2", "--mix names 'random' twice; give it one share"),
    ],
)
def test_what_is_no_mix_is_refused_by_name(text: str, said: str) -> None:
    with pytest.raises(BotError) as refused:
        parse_mix(text)
    assert said in str(refused.value)


@pytest.mark.parametrize("num_bots", [1, 2, 3, 7, 60, 101])
def test_all_bots_are_allotted_and_each_count_is_within_one_of_its_share(num_bots: int) -> None:
    shares = parse_mix("attentive=0.55,straight-liner=0.15,random=0.1,drop-out=0.1,double-clicker=0.1")
    counts = allot(shares, num_bots)
    assert sum(counts.values()) == num_bots
    assert all(abs(counts[name] - share * num_bots) < 1 for name, share in shares.items())


def test_whole_shares_are_met_exactly() -> None:
    assert allot(parse_mix("attentive=2,fast=1"), 9) == {"attentive": 6, "fast": 3}
