import pytest

from tests.web.studies import a_study, one_experiment
from webapp.bots.effects import parse_effects
from webapp.bots.errors import BotError

STUDY = a_study(
    experiments=one_experiment(["subgoals", "full"], drive={}, probe={"num_questions": 1}, satisfaction=True)
)


def test_an_effect_on_a_kind_holds_for_all_its_items_and_for_no_other_kind() -> None:
    effects = parse_effects(["subgoals=0.5"], STUDY)
    assert effects.on_rating("subgoals", "general") == effects.on_rating("subgoals", "satisfaction_3") == 0.5
    assert effects.on_rating("full", "general") == 0
    assert effects.on_prediction("subgoals") == effects.on_drive("subgoals") == 0


def test_an_effect_on_an_item_stands_instead_of_the_one_on_all() -> None:
    effects = parse_effects(["subgoals=0.5", "subgoals.general=-1"], STUDY)
    assert (effects.on_rating("subgoals", "general"), effects.on_rating("subgoals", "likeliness")) == (-1, 0.5)


def test_predictions_and_drives_have_effects_of_their_own() -> None:
    effects = parse_effects(["full.probe=0.2", "full.drive=-0.1"], STUDY)
    assert (effects.on_prediction("full"), effects.on_drive("full"), effects.on_rating("full", "general")) == (
        0.2,
        -0.1,
        0,
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("subgoal=1", "--effect names the kind 'subgoal'; did you mean 'subgoals'?"),
        ("everything=1", "the kinds of sakai2021 are subgoals, full"),
        ("full.generl=1", "--effect 'full.generl=1' is on 'generl'; did you mean 'general'?"),
        ("full", "--effect is 'full'; write KIND=DELTA"),
        ("full.=1", "--effect is 'full.=1'; write KIND=DELTA"),
        ("full=much", "--effect is 'full=much'; after the = stands a number"),
        ("full=nan", "--effect is 'full=nan'; after the = stands a number"),
        ("full.probe=1.5", "--effect is 'full.probe=1.5'; a difference of probabilities is from -1 to 1"),
    ],
)
def test_what_is_no_effect_is_refused_by_name(text: str, said: str) -> None:
    with pytest.raises(BotError) as refused:
        parse_effects([text], STUDY)
    assert said in str(refused.value)


def test_the_same_effect_has_one_value() -> None:
    with pytest.raises(BotError, match=r"--effect names 'full\.general' twice"):
        parse_effects(["full.general=1", "full.general=1"], STUDY)


def test_a_study_without_drives_has_no_effect_on_them() -> None:
    with pytest.raises(BotError, match="is on 'drive'"):
        parse_effects(["full.drive=0.5"], a_study(experiments=one_experiment(["full"])))
