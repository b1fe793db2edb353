"""Mistakes that people make in study files. Each is one small edit, and each is told in one line: place, value, wish.

`@` marks the line that the message has to name; it is taken out before the file is written.
"""

import shutil
from datetime import date
from pathlib import Path

import pytest

from webapp.stimuli.checking import check_study
from webapp.stimuli.sources import STUDIES
from webapp.study.problems import StudyError

Mistake = tuple[str, str, str]
"""What stands there, what somebody writes instead, and what they are told."""

NAME = "use up to 64 lower-case letters, digits, - and _, with a letter or digit at either end"
DAY = 'use a date such as "2030-12-31", or a placeholder in angle brackets'
WHOLE = "use a whole number, without quotes or a point"
KINDS = (
    "use 'full', 'subgoals', 'random', 'all_key_points', 'first_key_point', 'none', 'placebic', 'highlights', "
    "'landmarks', 'evenly_spaced', 'tailored_all', 'tailored_first', or declare [kinds.{}]"
)
AT_THE_TOP = "at the top of the file, before the first [section]"
ADDRESS = "use an address that begins with https://, without blanks"
BESIDE = "use the name of a file that lies beside study.toml, such as 'analysis_plan.md'"
UNTOLD = "although there is such an arm; participants have to be told at the end"
LAYOUTS = "practice, experiment1-a, experiment1-b, experiment1-c"

SETTINGS: list[Mistake] = [
    # A value of the wrong type.
    ("seed = 2021", '@seed = "2021"', f"seed: is '2021'; {WHOLE}"),
    ("seed = 2021", "@seed = 20.21", "seed: is 20.21; use a whole number, without quotes or a point"),
    ("seed = 2021", "@seed = true", f"seed: is true; {WHOLE}"),
    ('consent_version = "1"', "@consent_version = 1", "consent_version: is 1; use text in quotes"),
    ('languages = ["en", "ja"]', '@languages = "en"', "languages: is 'en'; use a list in square brackets"),
    (
        "straight_lining = true",
        '@straight_lining = "yes"',
        "quality.straight_lining: is 'yes'; use true or false, without quotes",
    ),
    (
        "min_total_minutes = 3.0",
        '@min_total_minutes = "3"',
        "quality.min_total_minutes: is '3'; use a number, without quotes",
    ),
    ("minimum_age = 16\n", '@minimum_age = "16"\n', f"consent.minimum_age: is '16'; {WHOLE}"),
    (
        'consent_version = "1"\n',
        'consent_version = "1"\n@recruitment = "sona"\n',
        "recruitment: is 'sona'; use a table",
    ),
    # A number out of its range.
    ("seed = 2021", "@seed = -1", "seed: is -1; use 0 or more"),
    ("lease_minutes = 60", "@lease_minutes = 1", "lease_minutes: is 1; use 5 or more"),
    ("# quota = 60", "@quota = 0", "quota: is 0; use 1 or more"),
    ("random_steps = 10", "@random_steps = 0", "explanation.random_steps: is 0; use 1 or more"),
    ("minimum_age = 16\n", "@minimum_age = 160\n", "consent.minimum_age: is 160; use 120 or less"),
    (
        "points = 5\nwithout_explanation",
        "@points = 12\nwithout_explanation",
        "experiments[1].items[1].points: is 12; use 11 or less",
    ),
    (
        "steps_per_optimal_step = 3.0",
        "@steps_per_optimal_step = 0.5",
        "experiments[1].drive.steps_per_optimal_step: is 0.5; use 1 or more",
    ),
    ("min_total_minutes = 3.0", "@min_total_minutes = 0.0", "quality.min_total_minutes: is 0.0; use more than 0"),
    ("attempts = 2", "@attempts = 11", "quiz.attempts: is 11; use 10 or less"),
    # A mistyped name of a setting or a section.
    (
        "minimum_age = 16\n",
        "@minimum_aeg = 16\n",
        "consent.minimum_aeg: is not a setting here; did you mean 'minimum_age'?",
    ),
    ("[consent]", "@[consnet]", "consnet: is not a setting here; did you mean 'consent'?"),
    ("attempts = 2", "@attemps = 2", "quiz.attemps: is not a setting here; did you mean 'attempts'?"),
    (
        "failed_quiz = true",
        "@failed_quizz = true",
        "quality.failed_quizz: is not a setting here; did you mean 'failed_quiz'?",
    ),
    ("[ask]", "[ask]\n@open = true", "ask.open: is not a setting here; there are none, so leave the section empty"),
    (
        "num_questions = 2",
        "@colour = 2",
        "experiments[1].probe.colour: is not a setting here; the settings are num_questions, states",
    ),
    (
        "num_questions = 2",
        "@quota = 60",
        f"experiments[1].probe.quota: is not a setting here; write 'quota' {AT_THE_TOP}",
    ),
    (
        "[ask]",
        "[learning.settings]\n@num_cycle = 4",
        "learning.settings.num_cycle: is not a setting of the training; did you mean 'num_cycles'?",
    ),
    ("[ask]", "@[learning.settings]\ndiscount = 1.5", "learning.settings: discount must be from 0 to 1, not 1.5"),
    # A mistyped choice.
    (
        'situation = "current_view"',
        '@situation = "curent_view"',
        "experiments[1].situation: is 'curent_view'; did you mean 'current_view'? use 'current_view' or 'video'",
    ),
    (
        'kinds = ["subgoals", ',
        '@kinds = ["subgoal", ',
        f"experiments[1].kinds[1]: is 'subgoal'; did you mean 'subgoals'? {KINDS.format('subgoal')}",
    ),
    (
        'importance = "return_probability"',
        '@importance = "saliency"',
        "explanation.importance: is 'saliency'; use 'return_probability' or 'ace'",
    ),
    (
        'when = "after_ratings"',
        '@when = "later"',
        "experiments[1].drive.when: is 'later'; use 'before_ratings' or 'after_ratings'",
    ),
    (
        'on_failure = "continue"',
        '@on_failure = "screenout"',
        "quiz.on_failure: is 'screenout'; did you mean 'screen_out'? use 'continue' or 'screen_out'",
    ),
    (
        'discloses = ["placebic"]',
        '@discloses = ["placebo"]',
        "debriefing.discloses[1]: is 'placebo'; did you mean 'placebic'? use 'placebic'",
    ),
    (
        'questions = [\n    { id = "age", type = "number"',
        '@questions = [\n    { id = "age", type = "age"',
        "background.questions[1].type: is 'age'; use 'choice', 'number' or 'text'",
    ),
    (
        "[ask]",
        '[recruitment]\n@service = "Prolific"',
        "recruitment.service: is 'Prolific'; did you mean 'prolific'? use 'prolific', 'sona' or 'label'",
    ),
    # A form that a value has to have.
    ('name = "understanding"', '@name = "My Study"', f"name: is 'My Study'; {NAME}"),
    ('languages = ["en", "ja"]', '@languages = ["EN"]', f"languages[1]: is 'EN'; {NAME}"),
    (
        'retention_until = "<date, such as 2030-12-31>"',
        '@retention_until = "31.12.2030"',
        f"retention_until: is '31.12.2030'; {DAY}",
    ),
    (
        'retention_until = "<date, such as 2030-12-31>"',
        "@retention_until = 2030-12-31T00:00:00",
        f"retention_until: is 2030-12-31T00:00:00; {DAY}",
    ),
    (
        'contact = "<name and e-mail address of the responsible researcher>"',
        '@contact = " "',
        "contact: is ' '; write something",
    ),
    (
        "[ask]",
        '[recruitment]\nservice = "sona"\n@completed = { link = "http://sona.example" }',
        f"recruitment.completed.link: is 'http://sona.example'; {ADDRESS}",
    ),
    (
        "[ask]",
        '[recruitment]\nservice = "sona"\n@completed = { link = "https://sona.example/{name}" }',
        "recruitment.completed.link: is 'https://sona.example/{name}'; it may use {code} and {id} only",
    ),
    (
        "[ask]",
        '[recruitment]\nservice = "sona"\n@completed = { code = "a b" }',
        "recruitment.completed.code: is 'a b'; use 3 to 64 letters, digits, - and _",
    ),
    (
        '# plan = "analysis_plan.md"',
        '@plan = "../plan.md"',
        f"analysis.plan: is '../plan.md'; {BESIDE}",
    ),
    # Something is missing or empty.
    (
        'contrasts = [\n    { experiment = "1", first = "subgoals", second = "placebic" },',
        '@contrasts = [\n    { experiment = "1", first = "subgoals" },',
        "analysis.contrasts[1].second: is missing",
    ),
    ("# alpha = 0.05", "@alpha = 0.5", "analysis.alpha: is 0.5; use 0.2 or less"),
    ("# alpha = 0.05", '@alpha = "5 %"', "analysis.alpha: is '5 %'; use a number, without quotes"),
    (
        "# alpha = 0.05",
        "@aplha = 0.05",
        "analysis.aplha: is not a setting here; did you mean 'alpha'?",
    ),
    ('languages = ["en", "ja"]', "@languages = []", "languages: is empty; list at least one"),
    ('[practice]\nlayout = "practice"', "@[practice]", "practice.layout: is missing"),
    # Settings that do not go together.
    (
        'layouts = ["experiment1-a", "experiment1-b", "experiment1-c"]',
        '@layouts = ["experiment1-a", "experiment1-b", "experiment1-d"]',
        f"experiments[1].layouts[3]: is 'experiment1-d', not one of the study's layouts: {LAYOUTS}",
    ),
    (
        'layout = "practice"',
        '@layout = "experiment1-a"',
        "practice.layout: is 'experiment1-a', which experiment '1' uses; add another",
    ),
    (
        "guardian_below = 18",
        "@guardian_below = 16",
        "consent.guardian_below: is 16; it should be above the minimum_age, 16",
    ),
    (
        'answer = "flag"',
        '@answer = "flags"',
        "quiz.questions[1].answer: is 'flags'; it should be one of the choices: key, flag, door",
    ),
    ("trial = 3", "@trial = 4", "attention_checks[2].trial: is 4; experiment '1' has 3 trials"),
    (
        'discloses = ["placebic"]',
        "@discloses = []",
        f"debriefing.discloses: does not list 'placebic', {UNTOLD}",
    ),
    (
        'situation = "current_view"',
        '@situation = "video"',
        "experiments[1].situation: is 'video', which needs a [experiments.question] that says when it stops",
    ),
    (
        '"placebic", "none"]',
        '@"placebic", "none", "all_key_points"]',
        "experiments[1].kinds[7]: is 'all_key_points', which answers a question; declare [experiments.question]",
    ),
    (
        "[ask]",
        '@[translations.fr]\nback_translation = "x"',
        "translations.fr: is not one of the languages after the first: ja",
    ),
    (
        "[ask]",
        "[learning]\n@seeds = { nowhere = 3 }",
        f"learning.seeds.nowhere: is not one of the study's layouts: {LAYOUTS}",
    ),
    (
        "failed_attention_checks = 2",
        "@failed_attention_checks = 3",
        "quality.failed_attention_checks: is 3, and there are 2 checks; declare [[attention_checks]]",
    ),
    (
        "# duplicates = true",
        "@duplicates = true",
        "quality.duplicates: is true, and no recruiter's id is stored to compare; declare [recruitment]",
    ),
    (
        'languages = ["en", "ja"]',
        '@languages = ["en", "ja", "en"]',
        "languages[3]: is 'en', which stands there 2 times; keep one",
    ),
]

SYNTAX: list[Mistake] = [
    ("seed = 2021", "seed = 2021\n@seed = 2022", "Cannot overwrite a value; it is there twice; keep one"),
    ("seed = 2021", "@seed 2021", "Expected '=' after a key in a key/value pair; write a setting as key = value"),
    (
        "seed = 2021",
        "@seed = yes",
        "Invalid value; use text in quotes, a number, true, false, or a list in square brackets",
    ),
    ('consent_version = "1"', '@consent_version = "1', "Illegal character '\\n'; close the quotes"),
    ("[ask]", "[ask]\n@[ask]", "Cannot declare ('ask',) twice; it is there twice; keep one"),
]

TEXTS: list[Mistake] = [
    (
        'title = "Round {position} of {num_trials}"',
        '@title = "Round {number}"',
        "experiments.1.title: names the parameter {number}; it may use {num_trials}, {position}",
    ),
    (
        'introduction = "The agent is about',
        '@introductoin = "The agent is about',
        "experiments.1.introductoin: nothing uses it; did you mean 'experiments.1.introduction', which is missing?",
    ),
    (
        'foresee = "How well can you foresee what the agent will do?"',
        "@foresee = 3",
        "items.foresee: is 3; write a text or a list of texts, none empty",
    ),
    ('high = "Very good"', '@high = " "', "scales.general.high: is ' '; write a text or a list of texts, none empty"),
    (
        '[study]\ntitle = "Do you see what the agent is up to?"',
        '[study]\n@title = ["Do you see?"]',
        "study.title: is ['Do you see?']; write one text",
    ),
    (
        '[items]\nforesee = "How well can you foresee what the agent will do?"',
        "@[items]",
        "items.foresee.1: is missing",
    ),
    (
        "[done]\nabout = [",
        '[done]\n@about = "All of it"\nmore = [',
        "done.about: is 'All of it'; write a list of texts",
    ),
]

MAPS: list[Mistake] = [
    ("#K..#..#", "#...#..#", "line 8, column 8: there is no key (K); put one on the map"),
    ("#.>.#..#", "#.>K#..#", "line 3, column 4: there is a second key (K); keep one"),
    ("#.>.#..#", "#.>.#.?#", "line 3, column 7: '?' is not a map character; use one of # . K D G > v < ^"),
    (
        "#.>.#..#",
        "#.>.#..",
        "line 3, column 8: the row has 7 cells and the first row has 8; make all rows equally long",
    ),
    ("#.>.#..#", "#.>.#...", "line 3, column 8: the outer border must be wall (#), not '.'"),
    ("#.>.#..#", "#...#..#", "line 8, column 8: there is no agent; put one of > v < ^ on the map"),
    (
        "#...D..#\n#...#.G#",
        "#...D.##\n#...##G#",
        "line 7, column 7: the goal cannot be reached from the agent's start; open a way with key and door",
    ),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(STUDIES / "understanding", tmp_path / "understanding"))


def told_after(file: Path, mistake: Mistake, folder: Path) -> tuple[list[str], int | None]:
    """Make a mistake in a file; return what is told, and the line that has to be named."""
    before, after, _ = mistake
    text = file.read_text(encoding="utf-8")
    assert before in text
    marked = text.replace(before, after, 1)
    line = marked[: marked.index(after)].count("\n") + after.partition("@")[0].count("\n") + 1 if "@" in after else None
    file.write_text(text.replace(before, after.replace("@", "", 1), 1), encoding="utf-8")
    with pytest.raises(StudyError) as error:
        check_study(folder, folder.parent / "instance", date(2026, 11, 27))
    return [problem.removeprefix(f"{folder}/") for problem in error.value.problems], line


def test_there_are_at_least_forty_of_them() -> None:
    assert len(SETTINGS) + len(SYNTAX) + len(TEXTS) + len(MAPS) >= 40


@pytest.mark.parametrize("mistake", SETTINGS, ids=[told for _, _, told in SETTINGS])
def test_a_mistake_in_the_study_file_is_told_with_its_line_its_value_and_a_wish(mistake: Mistake, folder: Path) -> None:
    told, line = told_after(folder / "study.toml", mistake, folder)
    assert told == [f"study.toml, line {line}: {mistake[2]}"]


@pytest.mark.parametrize("mistake", SYNTAX, ids=[told for _, _, told in SYNTAX])
def test_a_study_file_that_is_no_toml_is_told_with_line_and_column(mistake: Mistake, folder: Path) -> None:
    (told,), line = told_after(folder / "study.toml", mistake, folder)
    assert told.startswith(f"study.toml, line {line}, column ")
    assert told.endswith(f": not a TOML file: {mistake[2]}")


@pytest.mark.parametrize("mistake", TEXTS, ids=[told for _, _, told in TEXTS])
def test_a_mistake_in_the_texts_is_told_with_its_line(mistake: Mistake, folder: Path) -> None:
    told, line = told_after(folder / "texts" / "en.toml", mistake, folder)
    place = "texts/en.toml" if line is None else f"texts/en.toml, line {line}"
    assert told == [f"{place}: {mistake[2]}"]


@pytest.mark.parametrize("mistake", MAPS, ids=[told for _, _, told in MAPS])
def test_a_mistake_in_a_map_is_told_with_line_and_column(mistake: Mistake, folder: Path) -> None:
    told, _ = told_after(folder / "layouts" / "experiment1-a.txt", mistake, folder)
    assert told == [f"layouts/experiment1-a.txt, {mistake[2]}"]
