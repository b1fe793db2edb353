"""What a column of the data is, and the columns that several files share."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Type = Literal["text", "integer", "number", "boolean", "time"]
"""`boolean` is written as `true` or `false`, `time` as ISO 8601 in UTC: `2031-03-01T09:30:00.000017Z`."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A column.

    Attributes:
        name: As in the file's first line.
        type: What stands in it; an empty field means that there is no value.
        description: What it means.
        unit: What its numbers count, such as `ms`.
        minimum: The least value, None where there is no bound.
        maximum: The largest.
        levels: For a text that is one of few: what each stands for.
    """

    name: str
    type: Type
    description: str
    unit: str | None = None
    minimum: int | None = None
    maximum: int | None = None
    levels: Mapping[str, str] = field(default_factory=dict)


KINDS = {
    "full": "the whole way to the goal (Sakai et al. 2021)",
    "subgoals": "the subgoals of the way (Sakai et al. 2021)",
    "random": "steps of the way drawn at random (Sakai et al. 2021)",
    "all_key_points": "all subgoals that the questioner's own way misses (Sakai et al. 2021)",
    "first_key_point": "the first of these (Sakai et al. 2021)",
    "none": "no explanation",
    "placebic": "pictures that explain nothing",
    "highlights": "steps chosen by the method HIGHLIGHTS",
    "landmarks": "steps that every way to the goal passes",
    "evenly_spaced": "steps at equal distances",
    "tailored_all": "all subgoals that the participant's own first drive missed",
    "tailored_first": "the first of these",
}
"""The kinds of explanation that come with the program."""

ACTIONS = "`forward`, `left`, `right`, `pickup` or `toggle` in the worlds that come with the program"

WHO = (
    Variable("study", "text", "The study's name, as in its study file."),
    Variable(
        "study_version",
        "text",
        "SHA-256 of the study bundle that the participant saw. Different versions are different material.",
    ),
    Variable(
        "mode",
        "text",
        "Who took part.",
        levels={
            "live": "a participant of the study; these rows are the data",
            "test": "somebody trying it out",
            "bot": "a program",
        },
    ),
    Variable("participant", "text", "The participant's random code; the same in all files."),
)
"""Whose row it is; at the beginning of nearly every file."""

EXPERIMENT = Variable(
    "experiment", "text", "The experiment's id in the study file; empty where a page belongs to none."
)
TRIAL = Variable(
    "trial",
    "integer",
    "The trial's place within its experiment, in the order in which it was shown; empty where a page belongs to none.",
    minimum=1,
)
LAYOUT = Variable("layout", "text", "The world in which the agent acted, as in the study file.")
KIND = Variable(
    "kind", "text", "The kind of explanation that was shown; a study may declare kinds of its own.", levels=KINDS
)
DRAW = Variable(
    "draw",
    "integer",
    "Which of the seeded random explanations was shown; empty for every kind but `random`.",
    minimum=0,
)

WHAT = (EXPERIMENT, TRIAL, LAYOUT, KIND, DRAW)
"""Of which trial it is; empty where a page belongs to none."""

STATES = {
    "in_progress": "began and has not finished",
    "completed": "sent the last page",
    "withdrawn": "left the study",
    "screened_out": "used up the attempts at the quiz",
}
"""Where a participant is."""


def time(name: str, description: str) -> Variable:
    """Describe a time on the server's clock."""
    return Variable(name, "time", description)


def response_time(name: str = "response_time_ms") -> Variable:
    """Describe a response time."""
    description = (
        "From the first paint of the page to the last change of this answer, by the participant's browser. Empty where "
        "it runs no scripts, or measured nothing that makes sense."
    )
    return Variable(name, "integer", description, unit="ms", minimum=0, maximum=86_400_000)
