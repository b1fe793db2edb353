"""What a study is: its experiments, trials and questions, as declared by the study file and checked as a whole.

The file is TOML. Whoever edits it is told every problem at once, each with its place, its value and what is wanted.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from webapp.study.problems import StudyError, describe_problem, located

Kind = Literal["full", "subgoals", "random", "all_key_points", "first_key_point"]
"""The kinds of explanation of Sakai et al. 2021, section 6; of key points, all are shown or the first alone."""

KEY_POINT_KINDS: frozenset[Kind] = frozenset({"all_key_points", "first_key_point"})
"""The kinds that answer a question, so that they need an experiment with a questioner."""

LIVE_SETTINGS = ("contact", "ethics_approval", "retention_until")
"""What must be filled in before real data may be collected."""


def is_placeholder(value: str) -> bool:
    """Tell whether a setting still waits to be filled in: it is written in angle brackets, such as `<address>`."""
    return value.startswith("<") and value.endswith(">")


def _name(value: str) -> str:
    if not re.fullmatch(r"[a-z0-9](?:[a-z0-9_-]{0,62}[a-z0-9])?", value):
        raise ValueError("use up to 64 lower-case letters, digits, - and _, with a letter or digit at either end")
    return value


def _date_or_placeholder(value: str) -> str:
    if not is_placeholder(value):
        try:
            date.fromisoformat(value)
        except ValueError:
            raise ValueError('use a date such as "2030-12-31", or a placeholder in angle brackets') from None
    return value


def _as_tuple(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def _as_text(value: object) -> object:
    return value.isoformat() if isinstance(value, date) else value


Name = Annotated[str, AfterValidator(_name)]
Filled = Annotated[str, Field(min_length=1, pattern=r"\S")]
Day = Annotated[str, BeforeValidator(_as_text), AfterValidator(_date_or_placeholder)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]


class _Declared(BaseModel):
    """A part of the study file: unknown keys are refused, numbers are numbers, and nothing changes afterwards."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def _declared_list(least: int) -> list[object]:
    return [Field(min_length=least), BeforeValidator(_as_tuple)]


class Item(_Declared):
    """One question of the questionnaire, answered by a whole number from 1.

    The wording is the text `items.<id>.<experiment>`, or `items.<id>` where all experiments share it; the labels of
    the scale's ends are `scales.<id>.low` and `scales.<id>.high`.

    Attributes:
        id: The value of the column `item` of the data.
        points: The number of answers to choose from, 2 to 11.
    """

    id: Name
    points: Annotated[int, Field(ge=2, le=11)] = 5


class Question(_Declared):
    """Who asks for an explanation, and when (Sakai et al. 2021, section 6.2, made precise by us).

    Attributes:
        questioner: What the questioner believes. `door_open`: the door stands open and no key is needed.
        min_video_actions: The question comes after at least this many actions.
        num_announced_actions: How many of the next actions the participant is told.
    """

    questioner: Literal["door_open"]
    min_video_actions: Annotated[int, Field(ge=0)] = 2
    num_announced_actions: Annotated[int, Field(ge=1)] = 2


class Experiment(_Declared):
    """A block of trials: every participant sees each layout once, in this order, and each kind once, counterbalanced.

    Attributes:
        id: The value of the column `experiment` of the data.
        layouts: In the order in which everyone sees them.
        kinds: As many as layouts; which goes with which is counterbalanced.
        situation: What is shown first: the current view, or a video of the actions so far and the actions to come.
        question: Present exactly when the situation is a video.
        items: What is asked about every explanation, in this order.
    """

    id: Name
    layouts: Annotated[tuple[Name, ...], *_declared_list(1)]
    kinds: Annotated[tuple[Kind, ...], *_declared_list(1)]
    situation: Literal["current_view", "video"]
    question: Question | None = None
    items: Annotated[tuple[Item, ...], *_declared_list(1)]


class LearningSettings(_Declared):
    """What the study file says about training.

    Attributes:
        seeds: The seeds of layouts that need another than the study's, by layout.
        settings: Hyperparameters that differ from the defaults, by name; the build checks the names.
    """

    seeds: dict[Name, Seed] = Field(default_factory=dict)
    settings: dict[str, int | float] = Field(default_factory=dict)


class ExplanationSettings(_Declared):
    """How importance is measured and how often the random explanation is drawn.

    Attributes:
        importance: `return_probability` or `ace` (Sakai et al. 2021, section 4.2.1).
        random_steps: The number of random actions before the policy takes over.
        num_draws: The number of seeded draws of the random explanation, per layout.
    """

    importance: Literal["return_probability", "ace"] = "return_probability"
    random_steps: Annotated[int, Field(ge=1, le=1000)] = 10
    num_draws: Annotated[int, Field(ge=1, le=1000)] = 10


class Study(_Declared):
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
        experiments: In the order in which participants do them.
    """

    name: Name
    seed: Seed
    languages: Annotated[tuple[Name, ...], *_declared_list(1)]
    contact: Filled
    ethics_approval: Filled
    retention_until: Day
    consent_version: Filled
    layouts: Annotated[tuple[Name, ...], *_declared_list(1)]
    facts: Annotated[tuple[Name, ...], *_declared_list(1)]
    learning: LearningSettings = LearningSettings()
    explanation: ExplanationSettings = ExplanationSettings()
    experiments: Annotated[tuple[Experiment, ...], *_declared_list(1)]

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

    def training_seed(self, layout: str) -> int:
        """Return the seed with which a layout's agent is trained."""
        return self.learning.seeds.get(layout, self.seed)


def parse_study(text: str, source: str = "study.toml") -> Study:
    """Read and check a study file.

    Args:
        text: The file's text.
        source: What to call the file in messages.

    Raises:
        StudyError: The file cannot be used; the message has one line for each problem.
    """
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise StudyError([f"{source}: not a TOML file: {error}"]) from None
    problems = [located(text, source, path, message) for path, message in _contradictions(tree)]
    try:
        study = Study.model_validate(tree)
    except ValidationError as error:
        raise StudyError(
            [*(describe_problem(Study, problem, text, source) for problem in error.errors()), *problems]
        ) from None
    if problems:
        raise StudyError(problems)
    return study


_Problem = tuple[Sequence[str | int], str]
_Part = TypeVar("_Part", bound=_Declared)


def _contradictions(tree: Mapping[str, Any]) -> Iterator[_Problem]:
    """Yield what no single setting can see, each with the path of the setting to change.

    It works on the file as read, so that these problems are told together with those of single settings; parts that
    are wrong in themselves are passed over.
    """
    for key in ("languages", "layouts", "facts"):
        yield from _repeated((key,), _texts_of(tree.get(key)))
    layouts = _texts_of(tree.get("layouts"))
    learning = _valid(LearningSettings, tree.get("learning"))
    for layout in learning.seeds if learning else ():
        if layout not in layouts:
            yield ("learning", "seeds", layout), f"is not one of the study's layouts: {', '.join(layouts)}"
    declared = tree.get("experiments")
    experiments = [_valid(Experiment, part) for part in declared] if isinstance(declared, list) else []
    yield from _repeated(
        ("experiments",), [experiment.id if experiment else None for experiment in experiments], key="id"
    )
    for number, experiment in enumerate(experiments):
        for path, message in _contradictions_within(experiment, layouts) if experiment else ():
            yield ("experiments", number, *path), message


def _contradictions_within(experiment: Experiment, layouts: Sequence[str]) -> Iterator[_Problem]:
    yield from _repeated(("layouts",), experiment.layouts)
    yield from _repeated(("kinds",), experiment.kinds)
    yield from _repeated(("items",), [item.id for item in experiment.items], key="id")
    for number, layout in enumerate(experiment.layouts):
        if layout not in layouts:
            yield ("layouts", number), f"is {layout!r}, not one of the study's layouts: {', '.join(layouts)}"
    counts = len(experiment.kinds), len(experiment.layouts)
    if counts[0] != counts[1]:
        yield ("kinds",), f"has {counts[0]} kinds for {counts[1]} layouts; each kind goes with one layout"
    if experiment.situation == "video" and experiment.question is None:
        yield ("situation",), "is 'video', which needs a [experiments.question] that says when it stops"
    if experiment.situation == "current_view" and experiment.question is not None:
        yield ("question",), "belongs to a 'video'; remove it, or let the situation be 'video'"
    for number, kind in enumerate(experiment.kinds):
        if kind in KEY_POINT_KINDS and experiment.question is None:
            yield ("kinds", number), f"is {kind!r}, which answers a question; declare [experiments.question]"


def _repeated(path: Sequence[str | int], values: Sequence[str | None], key: str | None = None) -> Iterator[_Problem]:
    for value, count in Counter(values).items():
        if count > 1 and value is not None:
            second = [i for i, other in enumerate(values) if other == value][1]
            where = (*path, second) if key is None else (*path, second, key)
            yield where, f"is {value!r}, which stands there {count} times; keep one"


def _texts_of(value: object) -> list[str]:
    return [part for part in value if isinstance(part, str)] if isinstance(value, list) else []


def _valid(part: type[_Part], value: object) -> _Part | None:
    try:
        return part.model_validate(value)
    except ValidationError:
        return None
