"""The sections of a study file that stand around the experiments. Each can be left out."""

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from webapp.study.declared import Declared, Filled, Name, declared_list

MAX_TEXT_LENGTH = 500
"""The longest answer in a participant's own words, in characters."""

ATTENTION_POINTS = 5
"""An attention check looks like a rating with this many answers."""


def _code(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-]{3,64}", value):
        raise ValueError("use 3 to 64 letters, digits, - and _")
    return value


def _link(value: str) -> str:
    if not re.fullmatch(r"https://\S{1,490}", value):
        raise ValueError("use an address that begins with https://, without blanks")
    if set(re.findall(r"\{[^}]*\}?|\}", value)) - {"{code}", "{id}"}:
        raise ValueError("it may use {code} and {id} only")
    return value


def _file_name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}", value) or value == "study.toml":
        raise ValueError("use the name of a file that lies beside study.toml, such as 'analysis_plan.md'")
    return value


class Consent(Declared):
    """Who may take part.

    Attributes:
        minimum_age: In years; participants declare that they are not younger.
        guardian_below: Those younger than this also declare that a parent or guardian agrees; None if nobody has to.
    """

    minimum_age: Annotated[int, Field(ge=0, le=120)] = 18
    guardian_below: Annotated[int, Field(ge=1, le=120)] | None = None


class BackgroundQuestion(Declared):
    """A question about the participant; "prefer not to say" is always among the answers.

    The wording is the text `background.<id>.question`, that of a choice `background.<id>.choices.<choice>`.

    Attributes:
        id: The value of the column `question` of the data.
        type: `choice`: one of the choices. `number`: a whole number. `text`: the participant's own words.
        choices: What a question of type `choice` offers, in this order.
        minimum: The least number that a question of type `number` takes.
        maximum: The largest.
    """

    id: Name
    type: Literal["choice", "number", "text"]
    choices: Annotated[tuple[Name, ...], *declared_list(0)] = ()
    minimum: int = 0
    maximum: int = 120


class Background(Declared):
    """Questions about the participant, on one page before the instructions."""

    questions: Annotated[tuple[BackgroundQuestion, ...], *declared_list(1)]


class Practice(Declared):
    """A first drive that explains the 3x3 view and is not scored.

    Attributes:
        layout: One of the study's layouts that no experiment uses.
        steps_per_optimal_step: How many actions there are, as a multiple of the fewest that would do.
    """

    layout: Name
    steps_per_optimal_step: Annotated[float, Field(ge=1, le=20)] = 5.0


class QuizQuestion(Declared):
    """A question about what the instructions said.

    The wording is the text `quiz.<id>.question`, that of a choice `quiz.<id>.choices.<choice>`; `quiz.<id>.feedback`
    is shown after a wrong answer.

    Attributes:
        id: The value of the column `question` of the data.
        choices: The answers to choose from, in this order.
        answer: The right one.
    """

    id: Name
    choices: Annotated[tuple[Name, ...], *declared_list(2)]
    answer: Name


class Quiz(Declared):
    """A comprehension quiz after the instructions.

    Attributes:
        questions: All on one page.
        attempts: How often it may be answered until everything is right; after a wrong attempt there is feedback.
        on_failure: What happens when no attempt is left: go on all the same, or the study ends kindly.
    """

    questions: Annotated[tuple[QuizQuestion, ...], *declared_list(1)]
    attempts: Annotated[int, Field(ge=1, le=10)] = 2
    on_failure: Literal["continue", "screen_out"] = "continue"


class AttentionCheck(Declared):
    """An item among the ratings of one trial that says itself what to choose; it never ends the study.

    Recruiters accept such a check only if the item itself says plainly what to choose, asks for no knowledge or memory
    and looks like the others, and let nobody be refused for failing a single one in a study of five minutes or more.

    Attributes:
        id: The value of the column `question` of the data.
        experiment: The experiment in whose ratings it stands.
        trial: The trial's place within the experiment, from 1.
        answer: What is to be chosen, from 1 to 5.
    """

    id: Name
    experiment: Name
    trial: Annotated[int, Field(ge=1)]
    answer: Annotated[int, Field(ge=1, le=ATTENTION_POINTS)]


class ReturnPath(Declared):
    """How a participant who was recruited elsewhere gets back there.

    Attributes:
        code: The completion code to be shown, None for none.
        link: An https address to return to, None for none; `{code}` and `{id}` in it are filled in.
    """

    code: Annotated[str, AfterValidator(_code)] | None = None
    link: Annotated[str, AfterValidator(_link)] | None = None


class Recruitment(Declared):
    """Where participants come from, and how they get back.

    Attributes:
        service: `prolific` (PROLIFIC_PID, STUDY_ID, SESSION_ID), `sona` (id), or `label`, in the link's query.
            In a live study nobody gets in without them, who could not be paid; in a test run they may be missing.
        completed: For those who finished.
        screened_out: For those whom the quiz ended.
        no_consent: For those who do not take part.
        withdrawn: For those who left, so that they can be paid for their time.
    """

    service: Literal["prolific", "sona", "label"]
    completed: ReturnPath = ReturnPath()
    screened_out: ReturnPath = ReturnPath()
    no_consent: ReturnPath = ReturnPath()
    withdrawn: ReturnPath = ReturnPath()


class Debriefing(Declared):
    """What the study tells at its end besides what it was about.

    Attributes:
        discloses: Deceptions to be disclosed; the wording is the text `debriefing.<name>`. A study with a placebic
            arm has to disclose it.
    """

    discloses: Annotated[tuple[Literal["placebic"], ...], *declared_list(0)] = ()


class BehaviourLog(Declared):
    """Whether it is logged how participants look at the pictures; the consent then says so (`welcome.behaviour`)."""


class Ask(Declared):
    """The open page `/ask`, on which anybody can ask the agent about a layout; nothing is stored."""


class Translation(Declared):
    """What is known of a language that is not the study's first.

    Attributes:
        back_translation: Where the back-translation of the rating items is documented; without it they count as
            unvalidated.
    """

    back_translation: Filled


class Quality(Declared):
    """The exclusion rules, declared before there are data. Each is judged for everybody who was not left out already.

    A rule marks people; who is excluded in the end is said by name and with a reason. That somebody left the window is
    shown, and is no rule.

    Attributes:
        min_total_minutes: Whoever finished in less was too fast; None for no such rule.
        min_seconds_per_rating_page: Whoever took less, as the median over their rating pages, was too fast; None for
            no such rule.
        straight_lining: Whether those are marked whose every rating, over all trials and items, has the same value.
        failed_attention_checks: Whoever failed so many or more is marked; None for no such rule.
        failed_quiz: Whether those are marked who used up the quiz's attempts without a right one.
        duplicates: Whether those are marked whose recruiter's id or session is elsewhere in the live data too.
        incomplete: Whether those are marked who did not finish.
    """

    min_total_minutes: Annotated[float, Field(gt=0, le=600)] | None = None
    min_seconds_per_rating_page: Annotated[float, Field(gt=0, le=600)] | None = None
    straight_lining: bool = False
    failed_attention_checks: Annotated[int, Field(ge=1)] | None = None
    failed_quiz: bool = False
    duplicates: bool = False
    incomplete: bool = False


class PlannedContrast(Declared):
    """Two kinds of explanation of one experiment, which the analysis compares.

    Attributes:
        experiment: The experiment's id.
        first: The kind that is expected to be rated higher, or to be as good as the other.
        second: The kind that it is compared with; estimates are `first` minus `second`.
    """

    experiment: Name
    first: Name
    second: Name


class AnalysisPlan(Declared):
    """The planned analysis, frozen with the study when it is published.

    What is left out is filled in by `study.analysis_plan`, in one way for the check, the power and the report.

    Attributes:
        plan: A file in the study's folder; its text becomes part of the bundle. None for no such file.
        contrasts: The comparisons of the one family that is tested; empty if none are declared.
        equivalences: The pairs that are tested for being as good as each other; empty if none are declared.
        items: The items that are tested; empty for all of an experiment.
        alpha: The level of the family.
        equivalence_margin: Within how many points of a rating two kinds are as good as each other; None if undeclared.
    """

    plan: Annotated[str, AfterValidator(_file_name)] | None = None
    contrasts: Annotated[tuple[PlannedContrast, ...], *declared_list(0)] = ()
    equivalences: Annotated[tuple[PlannedContrast, ...], *declared_list(0)] = ()
    items: Annotated[tuple[Name, ...], *declared_list(0)] = ()
    alpha: Annotated[float, Field(gt=0, le=0.2)] = 0.05
    equivalence_margin: Annotated[float, Field(gt=0, le=10)] | None = None
