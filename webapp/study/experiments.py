"""The experiments of a study: which explanations are shown where, and what is asked and measured."""

from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, Field

from webapp.study.declared import Declared, Name, declared_list

BuiltInKind = Literal[
    "full",
    "subgoals",
    "random",
    "all_key_points",
    "first_key_point",
    "none",
    "placebic",
    "highlights",
    "landmarks",
    "evenly_spaced",
    "tailored_all",
    "tailored_first",
]
"""The kinds of explanation that come with the program.

The first five are those of Sakai et al. 2021, section 6; of key points, all are shown or the first alone. `none` to
`evenly_spaced` are arms to compare them with. A tailored kind shows the key points of the participant's own failed
drive, all or the first.
"""

BUILT_IN_KINDS: tuple[BuiltInKind, ...] = get_args(BuiltInKind)

Kind = str
"""A kind of explanation: a built-in one, or one of the study's own (`study.own_parts`)."""

MAX_KIND_LENGTH = 32
"""The longest name of a kind, in characters."""


def _kind_name(value: str) -> str:
    if len(value) > MAX_KIND_LENGTH:
        raise ValueError(f"use up to {MAX_KIND_LENGTH} characters for the name of a kind")
    return value


KindName = Annotated[Name, AfterValidator(_kind_name)]

KEY_POINT_KINDS: frozenset[Kind] = frozenset({"all_key_points", "first_key_point"})
"""The kinds that answer a question, so that they need an experiment with a questioner."""

TAILORED_KINDS: frozenset[Kind] = frozenset({"tailored_all", "tailored_first"})
"""The kinds that are made for the participant, who therefore drives first."""

SATISFACTION_ITEMS = tuple(f"satisfaction_{number}" for number in range(1, 10))
"""The nine items of the Explanation Satisfaction Scale (Hoffman, Mueller, Klein & Litman 2018, arXiv:1812.04608)."""


class Item(Declared):
    """One question of the questionnaire, answered by a whole number from 1.

    The wording is the text `items.<id>.<experiment>`, or `items.<id>` where all experiments share it; the labels of
    the scale's ends are `scales.<id>.low` and `scales.<id>.high`.

    Attributes:
        id: The value of the column `item` of the data.
        points: The number of answers to choose from, 2 to 11.
        without_explanation: Whether it is also asked of those who saw no explanation, the kind `none`.
    """

    id: Name
    points: Annotated[int, Field(ge=2, le=11)] = 5
    without_explanation: bool = False


class Question(Declared):
    """Who asks for an explanation, and when (Sakai et al. 2021, section 6.2, made precise by us).

    Attributes:
        questioner: What the questioner believes. `door_open`: the door stands open and no key is needed.
        min_video_actions: The question comes after at least this many actions.
        num_announced_actions: How many of the next actions the participant is told.
    """

    questioner: Literal["door_open"]
    min_video_actions: Annotated[int, Field(ge=0)] = 2
    num_announced_actions: Annotated[int, Field(ge=1)] = 2


class Drive(Declared):
    """The participant steers the agent to the goal: `P(reach target | explanation)` of the paper, measured on people.

    Attributes:
        when: Whether they drive between the explanation and the ratings, or after both.
        steps_per_optimal_step: How many actions they have, as a multiple of the fewest that would do.
        baseline: Whether everybody drives once before the explanation too, not only those whose explanation is
            tailored to it.
    """

    when: Literal["before_ratings", "after_ratings"] = "after_ratings"
    steps_per_optimal_step: Annotated[float, Field(ge=1, le=20)] = 3.0
    baseline: bool = False


class Probe(Declared):
    """The question "what will the agent do next?", with the confidence in the answer from 1 to 5.

    Attributes:
        num_questions: How many states are asked about after each explanation.
        states: Where they come from: the agent's `path` after the current state, or `elsewhere`.
    """

    num_questions: Annotated[int, Field(ge=1, le=10)] = 1
    states: Literal["path", "elsewhere"] = "path"


class Experiment(Declared):
    """A block of trials: every participant sees each layout once, with the kinds counterbalanced over them.

    Attributes:
        id: The value of the column `experiment` of the data.
        layouts: One trial each. Everyone sees them in this order, unless `layout_order` says otherwise.
        kinds: Which goes with which layout is counterbalanced; there may be more or fewer of them than layouts.
        situation: What is shown first: the current view, or a video of the actions so far and the actions to come.
        layout_order: `fixed`, as in the paper, or `counterbalanced`.
        question: Present exactly when the situation is a video.
        drive: Whether, when and for how long participants drive.
        probe: Whether participants predict the agent's next action.
        satisfaction: Whether the Explanation Satisfaction Scale follows the ratings.
        items: What is asked about every explanation, in this order.
    """

    id: Name
    layouts: Annotated[tuple[Name, ...], *declared_list(1)]
    kinds: Annotated[tuple[KindName, ...], *declared_list(1)]
    situation: Literal["current_view", "video"]
    layout_order: Literal["fixed", "counterbalanced"] = "fixed"
    question: Question | None = None
    drive: Drive | None = None
    probe: Probe | None = None
    satisfaction: bool = False
    items: Annotated[tuple[Item, ...], *declared_list(1)]

    def items_for(self, kind: Kind) -> tuple[Item, ...]:
        """Return what is asked about a kind of explanation; where nothing was explained that may be nothing."""
        return tuple(item for item in self.items if kind != "none" or item.without_explanation)
