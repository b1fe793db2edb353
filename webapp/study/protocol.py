"""What a study is: its experiments, trials and questions, as declared by the study file and checked as a whole.

The file is TOML. Whoever edits it is told every problem at once, each with its place, its value and what is wanted.
"""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, ValidationError
from pydantic_core import ErrorDetails

from webapp.study.contradictions import contradictions
from webapp.study.declared import Day, Declared, Filled, Name, Seed, declared_list, is_placeholder
from webapp.study.experiments import Experiment, Item, Kind
from webapp.study.learning_settings import ExplanationSettings, LearningSettings
from webapp.study.own_parts import OwnKinds, OwnWorlds
from webapp.study.problems import StudyError, describe_problem, located, read_toml
from webapp.study.sections import (
    AnalysisPlan,
    Ask,
    AttentionCheck,
    Background,
    BehaviourLog,
    Consent,
    Debriefing,
    Practice,
    Quality,
    Quiz,
    Recruitment,
    Translation,
)

__all__ = ["Experiment", "ExplanationSettings", "Item", "Kind", "LearningSettings", "Study", "parse_study"]

LIVE_SETTINGS = ("contact", "ethics_approval", "retention_until")
"""What must be filled in before real data may be collected."""

MOST_PARTICIPANTS = 1_000_000
"""The largest quota."""


class Study(Declared):
    """A declared study. `parse_study` makes one from the text of a study file.

    Attributes:
        name: The value of the column `study` of the data.
        seed: Everything random in the build follows from it.
        languages: The languages of the texts; the first is the default.
        contact: Whom participants can write to.
        ethics_approval: By whom the study was approved, and under which number.
        retention_until: Until when the data are kept, as `YYYY-MM-DD`.
        consent_version: Stored with every consent; change it when the consent text changes.
        layouts: Every layout of the bundle, named after its file; those of no experiment are built all the same.
        facts: What participants are told about the world, in this order; the wording is the text `facts.<id>`.
        learning: What differs from the default way of training.
        explanation: How explanations are computed.
        consent: Who may take part.
        background: Questions about the participant.
        practice: The drive that explains the view.
        quiz: The questions about the instructions.
        attention_checks: Items that say themselves what to choose.
        recruitment: Where participants come from.
        debriefing: What is disclosed at the end.
        behaviour_log: Present if it is logged how participants look at the pictures.
        ask: Present if the page `/ask` is open.
        quality: The declared exclusion rules.
        analysis: The planned analysis, None if none is declared.
        quota: How many people take part at most, those under way included; None for no limit.
        lease_minutes: After so long without a sign of life a participant's place goes to somebody else.
        kinds: Kinds of explanation of its own, by name.
        worlds: Layouts that are worlds of its own, by name.
        translations: What is known of the languages after the first, by code.
        experiments: In the order in which participants do them.
    """

    name: Name
    seed: Seed
    languages: Annotated[tuple[Name, ...], *declared_list(1)]
    contact: Filled
    ethics_approval: Filled
    retention_until: Day
    consent_version: Filled
    layouts: Annotated[tuple[Name, ...], *declared_list(1)]
    facts: Annotated[tuple[Name, ...], *declared_list(1)]
    learning: LearningSettings = LearningSettings()
    explanation: ExplanationSettings = ExplanationSettings()
    consent: Consent = Consent()
    background: Background | None = None
    practice: Practice | None = None
    quiz: Quiz | None = None
    attention_checks: Annotated[tuple[AttentionCheck, ...], *declared_list(0)] = ()
    recruitment: Recruitment | None = None
    debriefing: Debriefing = Debriefing()
    behaviour_log: BehaviourLog | None = None
    ask: Ask | None = None
    quality: Quality = Quality()
    analysis: AnalysisPlan | None = None
    quota: Annotated[int, Field(ge=1, le=MOST_PARTICIPANTS)] | None = None
    lease_minutes: Annotated[int, Field(ge=5, le=7 * 24 * 60)] = 60
    kinds: OwnKinds = Field(default_factory=dict)
    worlds: OwnWorlds = Field(default_factory=dict)
    translations: dict[Name, Translation] = Field(default_factory=dict)
    experiments: Annotated[tuple[Experiment, ...], *declared_list(1)]

    def placeholders(self) -> tuple[str, ...]:
        """Return the names of the settings that must still be filled in before real data may be collected."""
        return tuple(name for name in LIVE_SETTINGS if is_placeholder(getattr(self, name)))

    def experiment(self, experiment_id: str) -> Experiment:
        """Return an experiment by its id.

        Raises:
            KeyError: There is no such experiment.
        """
        for experiment in self.experiments:
            if experiment.id == experiment_id:
                return experiment
        raise KeyError(f"there is no experiment {experiment_id!r}")

    def checks_of(self, experiment_id: str, trial: int) -> tuple[AttentionCheck, ...]:
        """Return the attention checks among the ratings of a trial, given by its place in the experiment, from 1."""
        return tuple(
            check for check in self.attention_checks if (check.experiment, check.trial) == (experiment_id, trial)
        )

    def validation(self, language: str) -> Literal["original", "back_translated", "unvalidated"]:
        """Say how far the rating items of a language can be trusted to ask the same as those of the first."""
        if language == self.languages[0]:
            return "original"
        return "back_translated" if language in self.translations else "unvalidated"

    def training_seed(self, layout: str) -> int:
        """Return the seed with which a layout's agent is trained."""
        return self.learning.seeds.get(layout, self.seed)


MAX_TOLD = 100
"""How many problems of a study file are told at once."""


def parse_study(text: str, source: str = "study.toml") -> Study:
    """Read and check a study file.

    Args:
        text: The file's text.
        source: What to call the file in messages.

    Raises:
        StudyError: The file cannot be used; the message has one line for each problem.
    """
    tree = read_toml(text, source)
    problems = [located(text, source, path, message) for path, message in contradictions(tree)]
    try:
        study = Study.model_validate(tree)
    except ValidationError as error:
        causes = _first_causes(error)
        told = [describe_problem(Study, problem, text, source) for problem in causes[:MAX_TOLD]]
        if len(causes) > MAX_TOLD:
            told.append(f"{source}: has {len(causes) - MAX_TOLD} further problems; mend these first")
        raise StudyError(dict.fromkeys([*told, *problems])) from None
    if problems:
        raise StudyError(problems)
    return study


def _first_causes(error: ValidationError) -> list[ErrorDetails]:
    """Return pydantic's problems without those that follow.

    A list is not empty because its entries are wrong, and what is no number at all is no whole one either.
    """
    problems = error.errors()
    places = [problem["loc"] for problem in problems]
    return [problem for problem in problems if not _follows(problem, places)]


def _follows(problem: ErrorDetails, places: Sequence[tuple[int | str, ...]]) -> bool:
    place = problem["loc"]
    if problem["type"] == "too_short":
        return any(other != place and other[: len(place)] == place for other in places)
    return place[-1:] == ("int",) and (*place[:-1], "float") in places
