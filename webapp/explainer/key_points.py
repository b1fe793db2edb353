"""Key points: the subgoals that a questioner's route misses (Sakai et al. 2021, section 4.3, equations 4 and 5)."""

from collections.abc import Sequence

from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.solvers import Trajectory, check_step


def roll_out(mdp: DeterministicMDP, state: int, actions: Sequence[int]) -> Trajectory:
    """Predict where a sequence of actions leads.

    Args:
        mdp: The world, or what a model takes it to be.
        state: The index of the first state.
        actions: Action indices. Those after the end of the episode are left out.

    Raises:
        ValueError: There is no such state, or no such action.
    """
    if not 0 <= state < mdp.num_states:
        raise ValueError(f"there is no state {state}; there are {mdp.num_states}, from 0")
    for action in actions:
        if not 0 <= action < mdp.num_actions:
            raise ValueError(f"there is no action {action}; there are {mdp.num_actions}, from 0")
    states, taken = [state], []
    for action in actions:
        if mdp.terminal[states[-1]]:
            break
        taken.append(action)
        states.append(int(mdp.next_state[states[-1], action]))
    return Trajectory(tuple(states), tuple(taken))


def key_point_steps(
    mdp: DeterministicMDP, path: Trajectory, subgoals: Sequence[int], route: Sequence[int], from_step: int = 1
) -> tuple[int, ...]:
    r"""Return the subgoals whose state and action do not occur when the route is rolled out.

    The first of them is the explanation. A route that reaches the goal misses nothing: the paper asks only about
    routes that do not, and the set difference alone would blame those that merely differ.

    Args:
        mdp: The world in which the route is rolled out.
        path: The agent's path, whose states are indices into `mdp`.
        subgoals: Steps of the path, from 1, ascending; those before `from_step` lie behind and are left out.
        route: The questioner's actions `a_bad`, taken from the state of `from_step`.
        from_step: The step at which the question is asked, from 1 to T.

    Returns:
        Steps from `from_step` to T, ascending; empty when the route reaches the goal.

    Raises:
        ValueError: There is no such step or action.

    Example:
        >>> from webapp.explainer import follow, key_point_steps, parse_layout, plan_world, tabulate
        >>> world = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
        >>> policy = plan_world(world)
        >>> path = follow(world, policy)
        >>> route = [world.actions.index(name) for name in ("left", "left", "forward")]
        >>> key_point_steps(world, path, [1, 7], route)
        (1, 7)
    """
    check_step(path, from_step)
    rolled_out = roll_out(mdp, path.states[from_step - 1], route)
    if mdp.goal[rolled_out.states[-1]]:
        return ()
    understood = set(rolled_out.pairs)
    return tuple(step for step in subgoals if step >= from_step and path.pairs[step - 1] not in understood)
