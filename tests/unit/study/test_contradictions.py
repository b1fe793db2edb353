"""Settings that contradict each other: each is refused with its place, its value and what is wanted."""

import re
from pathlib import Path

import pytest

from webapp.study.problems import StudyError
from webapp.study.protocol import parse_study

STUDIES = Path(__file__).parents[3] / "webapp" / "studies"
PAPER = (STUDIES / "sakai2021" / "study.toml").read_text(encoding="utf-8")
FULL = (STUDIES / "understanding" / "study.toml").read_text(encoding="utf-8")
RECRUITMENT = '[recruitment]\nservice = "sona"\n'
BEFORE_EXPERIMENTS = "[[experiments]]\n"
NOT_A_LAYOUT = "not one of the study's layouts: practice, experiment1-a, experiment1-b, experiment1-c"
OWN_DRIVE = "made from the participant's own drive; declare [experiments.drive]"
UNTOLD = "although there is such an arm; participants have to be told at the end"


def problems_of(text: str) -> list[str]:
    """What is wrong with a study file; nothing if it can be used."""
    try:
        parse_study(text)
    except StudyError as error:
        return list(error.problems)
    return []


def changed(text: str, before: str, after: str) -> str:
    assert before in text, f"{before!r} does not stand in the study file"
    return text.replace(before, after, 1)


def without_plan(text: str) -> str:
    """A study file without its comparisons, of kinds that a test takes away."""
    return re.sub(r"\[analysis\].*?\n\n", "", text, count=1, flags=re.DOTALL)


def with_section(section: str, text: str = FULL) -> str:
    return changed(text, BEFORE_EXPERIMENTS, f"{section}\n{BEFORE_EXPERIMENTS}")


@pytest.mark.parametrize("text", [PAPER, FULL], ids=["sakai2021", "understanding"])
def test_the_shipped_studies_contradict_themselves_in_nothing(text: str) -> None:
    assert problems_of(text) == []


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        (
            'languages = ["en", "ja"]',
            'languages = ["en", "ja", "en"]',
            "languages[3]: is 'en', which stands there 2 times; keep one",
        ),
        (
            'layouts = ["practice", ',
            'layouts = ["practice", "practice", ',
            "layouts[2]: is 'practice', which stands there 2 times; keep one",
        ),
        (
            'facts = ["goal", ',
            'facts = ["goal", "goal", ',
            "facts[2]: is 'goal', which stands there 2 times; keep one",
        ),
        (
            'kinds = ["subgoals", ',
            'kinds = ["subgoals", "subgoals", ',
            "experiments[1].kinds[2]: is 'subgoals', which stands there 2 times; keep one",
        ),
        (
            'layouts = ["experiment1-a", ',
            'layouts = ["experiment1-a", "experiment1-a", ',
            "experiments[1].layouts[2]: is 'experiment1-a', which stands there 2 times; keep one",
        ),
        (
            'layouts = ["experiment1-a", ',
            'layouts = ["experiment9", ',
            f"experiments[1].layouts[1]: is 'experiment9', {NOT_A_LAYOUT}",
        ),
        (
            'id = "general"',
            'id = "loveliness"',
            "experiments[1].items[4].id: is 'loveliness', which stands there 2 times; keep one",
        ),
        (
            'id = "general"',
            'id = "satisfaction_3"',
            "experiments[1].items[4].id: is 'satisfaction_3', an item of the satisfaction scale; use another name",
        ),
        (
            'situation = "current_view"',
            'situation = "video"',
            "experiments[1].situation: is 'video', which needs a [experiments.question] that says when it stops",
        ),
        (
            'kinds = ["subgoals", ',
            'kinds = ["all_key_points", ',
            "experiments[1].kinds[1]: is 'all_key_points', which answers a question; declare [experiments.question]",
        ),
        (
            '[experiments.drive]\nwhen = "after_ratings"\nsteps_per_optimal_step = 3.0\n',
            "",
            f"experiments[1].kinds[2]: is 'tailored_all', {OWN_DRIVE}",
        ),
        (
            "guardian_below = 18",
            "guardian_below = 16",
            "consent.guardian_below: is 16; it should be above the minimum_age, 16",
        ),
        (
            '[practice]\nlayout = "practice"',
            '[practice]\nlayout = "nowhere"',
            f"practice.layout: is 'nowhere', {NOT_A_LAYOUT}",
        ),
        (
            '[practice]\nlayout = "practice"',
            '[practice]\nlayout = "experiment1-b"',
            "practice.layout: is 'experiment1-b', which experiment '1' uses; add another",
        ),
        (
            '{ id = "robots", type',
            '{ id = "gender", type',
            "background.questions[3].id: is 'gender', which stands there 2 times; keep one",
        ),
        (
            '["woman", "man", "another"]',
            '["woman", "man", "man"]',
            "background.questions[2].choices[3]: is 'man', which stands there 2 times; keep one",
        ),
        (
            ', choices = ["woman", "man", "another"]',
            "",
            "background.questions[2].choices: belong to the type 'choice' and to no other, and this is 'choice'",
        ),
        (
            'type = "number", minimum',
            'type = "number", choices = ["old"], minimum',
            "background.questions[1].choices: belong to the type 'choice' and to no other, and this is 'number'",
        ),
        (
            "minimum = 16, maximum = 120",
            "minimum = 16, maximum = 15",
            "background.questions[1].minimum: is 16, above the maximum, 15",
        ),
        (
            'id = "door"',
            'id = "goal"',
            "quiz.questions[2].id: is 'goal', which stands there 2 times; keep one",
        ),
        (
            '["key", "flag", "door"]',
            '["key", "flag", "key"]',
            "quiz.questions[1].choices[3]: is 'key', which stands there 2 times; keep one",
        ),
        (
            'answer = "flag"',
            'answer = "wall"',
            "quiz.questions[1].answer: is 'wall'; it should be one of the choices: key, flag, door",
        ),
        (
            'id = "check-b"',
            'id = "check-a"',
            "attention_checks[2].id: is 'check-a', which stands there 2 times; keep one",
        ),
        (
            '[[attention_checks]]\nid = "check-b"\nexperiment = "1"\ntrial = 3\nanswer = 4\n',
            "",
            "attention_checks: has a single check; recruiters let nobody be refused for one, so declare two",
        ),
        (
            'id = "check-b"\nexperiment = "1"',
            'id = "check-b"\nexperiment = "2"',
            "attention_checks[2].experiment: is '2'; the experiments are 1",
        ),
        (
            'id = "check-b"\nexperiment = "1"\ntrial = 3',
            'id = "check-b"\nexperiment = "1"\ntrial = 4',
            "attention_checks[2].trial: is 4; experiment '1' has 3 trials",
        ),
        (
            "without_explanation = true\n",
            "",
            "attention_checks[1].experiment: is '1', where those who see no explanation have no ratings to check",
        ),
        (
            'discloses = ["placebic"]',
            "discloses = []",
            f"debriefing.discloses: does not list 'placebic', {UNTOLD}",
        ),
        (
            '"placebic", "none"]',
            '"none"]',
            "debriefing.discloses: lists 'placebic', and no experiment has such an arm; remove it",
        ),
    ],
)
def test_a_contradiction_is_named_with_its_place_its_value_and_the_wish(before: str, after: str, problem: str) -> None:
    told = problems_of(changed(FULL, before, after))
    assert problem in [line.partition(": ")[2] for line in told], told


@pytest.mark.parametrize(
    ("section", "problem"),
    [
        (
            "[learning.seeds]\nnowhere = 3",
            f"learning.seeds.nowhere: is {NOT_A_LAYOUT}",
        ),
        (
            '[translations.fr]\nback_translation = "somewhere"',
            "translations.fr: is not one of the languages after the first: ja",
        ),
        (
            '[translations.en]\nback_translation = "somewhere"',
            "translations.en: is not one of the languages after the first: ja",
        ),
        (
            RECRUITMENT + 'completed = { link = "https://example.org/?cc={code}" }',
            "recruitment.completed.code: is missing, and the link uses it",
        ),
        (
            RECRUITMENT + 'withdrawn = { code = "CODE", link = "https://example.org/?who={name}" }',
            "recruitment.withdrawn.link: is 'https://example.org/?who={name}'; it may use {code} and {id} only",
        ),
        (
            RECRUITMENT + 'no_consent = { link = "https://example.org/{}" }',
            "recruitment.no_consent.link: is 'https://example.org/{}'; it may use {code} and {id} only",
        ),
        (
            RECRUITMENT + 'screened_out = { link = "https://example.org/{" }',
            "recruitment.screened_out.link: is 'https://example.org/{'; it may use {code} and {id} only",
        ),
    ],
)
def test_a_section_that_does_not_fit_is_named(section: str, problem: str) -> None:
    told = problems_of(with_section(section))
    assert [line.partition(": ")[2] for line in told] == [problem]
    assert told[0].startswith("study.toml, line ")


@pytest.mark.parametrize(
    "section",
    [
        '[translations.ja]\nback_translation = "somewhere"',
        "[learning.seeds]\npractice = 3",
        RECRUITMENT,
        RECRUITMENT + 'completed = { code = "CODE" }',
        RECRUITMENT + 'completed = { code = "CODE", link = "https://example.org/?cc={code}&who={id}" }',
        RECRUITMENT + 'withdrawn = { link = "https://example.org/?who={id}" }',
    ],
)
def test_a_section_that_fits_is_taken(section: str) -> None:
    assert problems_of(with_section(section)) == []


def test_a_question_without_a_video_is_refused() -> None:
    (problem,) = problems_of(changed(PAPER, 'situation = "video"', 'situation = "current_view"'))
    assert problem.endswith(
        ": experiments[2].question: belongs to a 'video'; remove it, or let the situation be 'video'"
    )


def test_two_experiments_of_one_name_are_refused() -> None:
    (problem,) = problems_of(changed(PAPER, 'id = "2"', 'id = "1"'))
    assert problem.endswith(": experiments[2].id: is '1', which stands there 2 times; keep one")


def test_no_explanation_needs_something_that_is_measured_all_the_same() -> None:
    wish = "declare [experiments.drive], [experiments.probe] or an item with without_explanation = true"
    nothing = changed(without_plan(PAPER), '"random"]', '"none"]')
    (problem,) = problems_of(nothing)
    assert problem.endswith(f": experiments[1].kinds[3]: is 'none', of which nothing would be measured; {wish}")
    kinds, item = 'kinds = ["full", "subgoals", "none"]\n', 'id = "likeliness"\n'
    for before, measured in ((kinds, "drive = {}"), (kinds, "probe = {}"), (item, "without_explanation = true")):
        assert problems_of(changed(nothing, before, f"{before}{measured}\n")) == []


def test_the_guardians_age_is_left_alone_where_nobody_needs_one() -> None:
    assert problems_of(changed(FULL, "guardian_below = 18\n", "")) == []


def test_all_contradictions_are_told_at_once_and_with_the_mistakes_of_single_settings() -> None:
    text = changed(FULL, "guardian_below = 18", "guardian_below = 3")
    text = changed(text, 'discloses = ["placebic"]', "discloses = []")
    text = changed(text, "attempts = 2", "attempts = 0")
    named = [line.partition(": ")[2].partition(":")[0] for line in problems_of(text)]
    assert sorted(named) == ["consent.guardian_below", "debriefing.discloses", "quiz.attempts"]


def test_prolific_needs_a_way_back_for_every_ending_that_can_be_met() -> None:
    told = problems_of(with_section('[recruitment]\nservice = "prolific"\ncompleted = { code = "CODE1" }'))
    assert [line.split(": ")[1] for line in told] == ["recruitment.no_consent", "recruitment.withdrawn"]
    screening = changed(FULL, 'on_failure = "continue"', 'on_failure = "screen_out"')
    told = problems_of(with_section('[recruitment]\nservice = "prolific"', screening))
    assert len(told) == 4
    assert all(line.endswith("give it a code or a link, or these people cannot be told apart") for line in told)


def test_equal_codes_are_refused() -> None:
    section = 'completed = { code = "SAME" }\nwithdrawn = { code = "SAME" }'
    (told,) = problems_of(with_section(RECRUITMENT + section))
    assert told.endswith("recruitment.withdrawn.code: is 'SAME', the code of completed too; use another")


def test_an_entry_that_is_wrong_does_not_make_its_list_look_empty() -> None:
    (told,) = problems_of(changed(FULL, 'when = "after_ratings"', 'when = "sometimes"'))
    assert "experiments[1].drive.when: is 'sometimes'; use 'before_ratings' or 'after_ratings'" in told
    (told,) = problems_of(changed(FULL, 'choices = ["never", "some", "often"]', 'choices = ["never", "SOME"]'))
    assert "'SOME'" in told


def test_the_choice_that_is_always_offered_cannot_be_declared() -> None:
    (told,) = problems_of(changed(FULL, 'choices = ["never", "some", "often"]', 'choices = ["prefer_not_to_say"]'))
    assert told.endswith("which is always offered; remove it")
