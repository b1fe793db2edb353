"""How a bot drives: the best way with a declared skill, or somewhere and then no further."""

import math
import random
from dataclasses import dataclass

from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.world_table import WorldTable
from webapp.study.session import Page

GIVE_UP = "give_up"


@dataclass(frozen=True, slots=True)
class Course:
    """Where a drive takes place.

    Attributes:
        world: The world.
        start: The state in which it begins.
        step_limit: How many actions there are.
    """

    world: WorldTable
    start: int
    step_limit: int


@dataclass(frozen=True, slots=True)
class Intention:
    """What a bot is going to do in a drive.

    Attributes:
        arrives: Whether it reaches the goal; it then never takes a detour that the actions left do not allow.
        skill: The probability of a best action at each step on the way there.
        patience: After how many actions one gives up who does not arrive.
    """

    arrives: bool
    skill: float
    patience: int


def course_of(catalogue: Catalogue, page: Page) -> Course:
    """Return the course of a page on which participants drive.

    Raises:
        ValueError: The study declares no such drive.
    """
    study = catalogue.study
    drive = study.practice if page.trial is None else study.experiment(page.trial.experiment).drive
    if drive is None:
        raise ValueError(f"page {page.number} has no drive")
    layout = study.practice.layout if page.trial is None and study.practice else getattr(page.trial, "layout", "")
    world = catalogue.world(layout)
    start = world.state_of_step(1 if page.trial is None else catalogue.from_step(page.trial))
    return Course(world, start, math.ceil(_distance(world, start) * drive.steps_per_optimal_step))


def next_action(course: Course, actions: list[str], intention: Intention, rng: random.Random) -> str:
    """Choose the action after those taken so far, or `GIVE_UP`."""
    world, state = course.world, course.world.roll_out(course.start, actions)[-1]
    if not intention.arrives:
        safe = [action for action in world.actions if not world.is_terminal(world.next_state(state, action))]
        return GIVE_UP if len(actions) >= intention.patience or not safe else rng.choice(safe)
    num_left = course.step_limit - len(actions) - 1
    distances = {action: world.optimum(world.next_state(state, action)) for action in world.actions}
    allowed = {action: steps for action, steps in distances.items() if steps is not None and steps <= num_left}
    best = [action for action, steps in allowed.items() if steps < _distance(world, state)]
    if rng.random() < intention.skill:
        policy = world.policy_action(state)
        return policy if policy in best else rng.choice(best)
    return rng.choice(list(allowed))


def _distance(world: WorldTable, state: int) -> int:
    found = world.optimum(state)
    if found is None:
        raise ValueError(f"no goal is reached from state {state} of {world.layout}")
    return found
