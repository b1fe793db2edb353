import json
import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from webapp.study.declared import is_placeholder
from webapp.study.problems import StudyError
from webapp.study.protocol import Study, parse_study

STUDIES = Path(__file__).parents[3] / "webapp" / "studies"
TEXT = (STUDIES / "sakai2021" / "study.toml").read_text(encoding="utf-8")


def problems_after(*changes: tuple[str, str]) -> tuple[str, ...]:
    """Change the shipped study file, each change once and at its first place, and return what is wrong with it then."""
    text = TEXT
    for before, after in changes:
        assert before in text, f"{before!r} does not stand in the study file"
        text = text.replace(before, after, 1)
    with pytest.raises(StudyError) as error:
        parse_study(text)
    assert str(error.value) == "\n".join(error.value.problems)
    return error.value.problems


def line_of(content: str, text: str = TEXT) -> int:
    return next(number for number, line in enumerate(text.splitlines(), start=1) if line.startswith(content))


@pytest.fixture(scope="module")
def study() -> Study:
    return parse_study(TEXT)


def test_the_shipped_study_is_the_two_experiments_of_the_paper(study: Study) -> None:
    first, second = study.experiments
    assert first.layouts == ("experiment1-a", "experiment1-b", "experiment1-c")
    assert set(first.kinds) == {"full", "subgoals", "random"}
    assert (first.situation, first.question) == ("current_view", None)
    assert second.layouts == ("experiment2-a", "experiment2-b")
    assert set(second.kinds) == {"all_key_points", "first_key_point"}
    assert second.situation == "video"
    assert second.question is not None
    assert (second.question.min_video_actions, second.question.num_announced_actions) == (2, 2)
    for experiment in study.experiments:
        assert [(item.id, item.points) for item in experiment.items] == [
            ("likeliness", 5),
            ("loveliness", 5),
            ("general", 5),
        ]
    assert len(study.facts) == 3
    assert (study.explanation.random_steps, study.explanation.num_draws) == (10, 10)


def test_the_shipped_study_waits_to_be_filled_in_before_it_can_go_live(study: Study) -> None:
    assert study.placeholders() == ("contact", "ethics_approval", "retention_until")


def test_a_filled_in_study_has_no_placeholders_left() -> None:
    text = TEXT
    for name, value in (
        ("contact", "a@example.org"),
        ("ethics_approval", "Board 7"),
        ("retention_until", "2031-01-31"),
    ):
        line = TEXT.splitlines()[line_of(name) - 1]
        text = text.replace(line, f'{name} = "{value}"')
    assert parse_study(text).placeholders() == ()


def test_only_a_value_wholly_in_angle_brackets_is_a_placeholder() -> None:
    assert is_placeholder("<name>")
    assert not is_placeholder("Somebody <somebody@example.org>")
    assert not is_placeholder("somebody@example.org")


def test_a_date_may_be_written_as_a_toml_date() -> None:
    line = TEXT.splitlines()[line_of("retention_until") - 1]
    assert parse_study(TEXT.replace(line, "retention_until = 2031-01-31")).retention_until == "2031-01-31"


def test_a_study_survives_being_written_as_json(study: Study) -> None:
    assert Study.model_validate_json(study.model_dump_json()) == study


def test_a_study_never_changes(study: Study) -> None:
    with pytest.raises(ValidationError, match="frozen"):
        study.seed = 5  # type: ignore[misc]


def test_a_layout_is_trained_with_the_studys_seed_unless_it_has_its_own() -> None:
    study = parse_study(TEXT + '\n[learning.seeds]\n"experiment1-b" = 7\n')
    assert [study.training_seed(name) for name in ("experiment1-a", "experiment1-b")] == [study.seed, 7]


def test_an_unknown_experiment_is_named(study: Study) -> None:
    with pytest.raises(KeyError, match="'3'"):
        study.experiment("3")


@pytest.mark.parametrize(
    ("before", "after", "line", "message"),
    [
        ("seed = 2021", "sead = 2021", "sead", "sead: is not a setting here; did you mean 'seed'?"),
        ("seed = 2021", "seed = -1", "seed", "seed: is -1; use 0 or more"),
        ("seed = 2021", 'seed = "2021"', "seed", "seed: is '2021'; use a whole number, without quotes or a point"),
        ("seed = 2021", "seed = true", "seed", "seed: is true; use a whole number, without quotes or a point"),
        ('name = "sakai2021"', 'name = "Sakai 2021"', "name", "name: is 'Sakai 2021'; use up to 64 lower-case letters"),
        ("random_steps = 10", "random_step = 10", "random_step", "did you mean 'random_steps'?"),
        ("num_draws = 10", "num_draws = 0", "num_draws", "explanation.num_draws: is 0; use 1 or more"),
        ('"return_probability"', '"luck"', "importance", "is 'luck'; use 'return_probability' or 'ace'"),
        ('["full",', '["ful",', "kinds", "experiments[1].kinds[1]: is 'ful'; did you mean 'full'? use 'full'"),
        ("points = 5", "points = 1", "points", "experiments[1].items[1].points: is 1; use 2 or more"),
        ('["en", "ja"]', "[]", "languages", "languages: is empty; list at least one"),
        ('"<date, such as 2030-12-31>"', '"soon"', "retention", "retention_until: is 'soon'; use a date such as"),
        ('"random"]', '"random", "full"]', "kinds", "experiments[1].kinds[4]: is 'full', which stands there 2 times"),
        ('"full", ', '"random", ', "kinds", "experiments[1].kinds[3]: is 'random', which stands there 2 times"),
        ('"full", ', '"first_key_point", ', "kinds", "is 'first_key_point', which answers a question; declare"),
        ('"experiment1-c"]', '"experiment1-d"]', 'layouts = ["', "is 'experiment1-d', not one of the study's layouts"),
        ('"current_view"', '"video"', "situation", "experiments[1].situation: is 'video', which needs a"),
        ('situation = "video"', 'situation = "current_view"', "[experiments.question]", "belongs to a 'video'; remove"),
        ('id = "2"', 'id = "1"', 'id = "1"', "experiments[2].id: is '1', which stands there 2 times; keep one"),
        ('"door_open"', '"no_door"', "questioner", "experiments[2].question.questioner: is 'no_door'; use 'door_open'"),
        ('facts = ["goal",', 'facts = ["goal", "goal",', "facts", "facts[2]: is 'goal', which stands there 2 times"),
    ],
)
def test_a_wrong_setting_is_named_with_its_line_its_value_and_the_wish(
    before: str, after: str, line: str, message: str
) -> None:
    changed = TEXT.replace(before, after, 1)
    numbers = [number for number, content in enumerate(changed.splitlines(), start=1) if content.startswith(line)]
    problems = problems_after((before, after))
    assert any(message in problem for problem in problems), problems
    named = next(problem for problem in problems if message in problem)
    assert any(named.startswith(f"study.toml, line {number}: ") for number in numbers), named


def test_all_problems_are_told_at_once() -> None:
    problems = problems_after(
        ("seed = 2021", "sead = 2021"),
        ("num_draws = 10", "num_draws = -3"),
        ('"random"]', '"random", "none"]'),
        ('"experiment2-b"]', '"nowhere"]'),
        ("questioner =", "asker ="),
    )
    for part in ("sead", "seed: is missing", "num_draws", "is 'none', of which", "questioner: is missing", "asker"):
        assert any(part in problem for problem in problems), (part, problems)


def test_a_seed_for_a_layout_that_is_not_there_is_refused() -> None:
    with pytest.raises(StudyError, match=r"learning\.seeds\.experiment9: is not one of the study's layouts"):
        parse_study(TEXT + "\n[learning.seeds]\nexperiment9 = 7\n")


def test_an_override_of_a_training_setting_is_a_number() -> None:
    assert parse_study(TEXT + "\n[learning.settings]\nnum_cycles = 4\n").learning.settings == {"num_cycles": 4}
    with pytest.raises(StudyError, match=r"line \d+: learning\.settings\.num_cycles: is true; "):
        parse_study(TEXT + "\n[learning.settings]\nnum_cycles = true\n")


def test_a_file_that_is_not_toml_is_refused_with_its_line() -> None:
    with pytest.raises(StudyError, match=r"my\.toml, line 2, column 8: not a TOML file: "):
        parse_study('name = "a"\nseed = = 3', "my.toml")


@pytest.mark.parametrize("text", ["", "experiments = 3", "learning = []", "layouts = [1, 2]\nexperiments = [3]"])
def test_a_file_that_is_no_study_at_all_is_refused_without_a_crash(text: str) -> None:
    with pytest.raises(StudyError) as error:
        parse_study(text)
    assert "study.toml: name: is missing" in error.value.problems


def test_the_paper_has_nothing_around_its_trials_but_a_consent_and_the_open_page(study: Study) -> None:
    assert (study.background, study.practice, study.quiz, study.recruitment, study.behaviour_log) == (None,) * 5
    assert (study.attention_checks, study.debriefing.discloses) == ((), ())
    assert study.ask is not None
    assert (study.consent.minimum_age, study.consent.guardian_below) == (16, None)
    for experiment in study.experiments:
        assert (experiment.drive, experiment.probe, experiment.satisfaction) == (None, None, False)
        assert experiment.layout_order == "fixed"


@pytest.fixture(scope="module")
def full_study() -> Study:
    """The shipped study in which everything is switched on."""
    return parse_study((STUDIES / "understanding" / "study.toml").read_text(encoding="utf-8"))


def test_everything_can_be_declared_around_the_trials(full_study: Study) -> None:
    assert full_study.background is not None
    assert [question.type for question in full_study.background.questions] == ["number", "choice", "choice", "choice"]
    assert full_study.quiz is not None
    assert (full_study.quiz.attempts, full_study.quiz.on_failure) == (2, "continue")
    assert full_study.practice is not None
    assert full_study.practice.layout not in full_study.experiments[0].layouts
    (experiment,) = full_study.experiments
    assert len(experiment.kinds) == 2 * len(experiment.layouts)
    assert experiment.drive is not None
    assert (experiment.drive.when, experiment.drive.steps_per_optimal_step) == ("after_ratings", 3.0)
    assert experiment.probe is not None
    assert full_study.debriefing.discloses == ("placebic",)


def test_each_section_can_be_left_out(full_study: Study) -> None:
    tree = full_study.model_dump(mode="json", exclude_none=True)
    for section in (
        *("consent", "background", "practice", "quiz", "attention_checks", "recruitment", "behaviour_log", "ask"),
        *("translations", "explanation", "learning"),
    ):
        rest = {name: value for name, value in tree.items() if name != section}
        assert isinstance(Study.model_validate_json(json.dumps(rest)), Study)


def test_a_full_study_survives_being_written_as_json(full_study: Study) -> None:
    assert Study.model_validate_json(full_study.model_dump_json()) == full_study


def test_attention_checks_belong_to_one_trial_each(full_study: Study) -> None:
    found = {(number, check.id) for number in (1, 2, 3) for check in full_study.checks_of("1", number)}
    assert found == {(1, "check-a"), (3, "check-b")}
    assert full_study.checks_of("2", 1) == ()


def test_a_translation_is_unvalidated_until_its_back_translation_is_cited() -> None:
    text = (STUDIES / "understanding" / "study.toml").read_text(encoding="utf-8")
    study = parse_study(text)
    assert [study.validation(language) for language in ("en", "ja")] == ["original", "unvalidated"]
    cited = parse_study(f'{text}\n[translations.ja]\nback_translation = "https://example.org/back"\n')
    assert [cited.validation(language) for language in ("en", "ja")] == ["original", "back_translated"]


def test_items_of_no_explanation_are_those_that_say_so(full_study: Study) -> None:
    (experiment,) = full_study.experiments
    assert [item.id for item in experiment.items_for("none")] == ["foresee"]
    assert [item.id for item in experiment.items_for("placebic")] == ["foresee", "likeliness", "loveliness", "general"]


def test_kinds_and_layouts_need_not_be_equal_in_number() -> None:
    for kinds in ('"full"]', '"full", "subgoals", "random", "highlights", "landmarks", "evenly_spaced"]'):
        text = re.sub(r"\[analysis\].*?\n\n", "", TEXT, count=1, flags=re.DOTALL)
        study = parse_study(text.replace('"full", "subgoals", "random"]', kinds, 1))
        assert len(study.experiments[0].kinds) != len(study.experiments[0].layouts)
