"""Gymnasium's environments by name: found, made with options, read from their tables, or refused."""

import itertools
from collections import deque
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.toy_text.frozen_lake import MAPS, FrozenLakeEnv
from gymnasium.envs.toy_text.taxi import TaxiEnv

from tests.conftest import ROOT
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.reachability import reach_probability
from webapp.explainer.solvers import follow, plan
from webapp.explainer.stochastic import StochasticMDP
from webapp.explainer.stochastic_planning import plan_world
from webapp.explainer.worlds.enumeration import enumerate_world
from webapp.explainer.worlds.finite import NotFinite, describe_state
from webapp.explainer.worlds.gymnasium_worlds import parse_options, resolve_id, world_of
from webapp.explainer.worlds.tabular_worlds import TableWorld, TaxiState

LAKE_MOVES = {"left": (0, -1), "down": (1, 0), "right": (0, 1), "up": (-1, 0)}
LAKE_ACTIONS = ("left", "down", "right", "up")

Chances = dict[tuple[int, int], float]


def deterministic(env_id: str, *, seed: int = 0, **options: object) -> DeterministicMDP:
    mdp = enumerate_world(world_of(env_id, seed=seed, options=options))
    assert isinstance(mdp, DeterministicMDP)
    return mdp


def stochastic(env_id: str, **options: object) -> StochasticMDP:
    mdp = enumerate_world(world_of(env_id, options=options))
    assert isinstance(mdp, StochasticMDP)
    return mdp


def lake(rows: list[str], cell: tuple[int, int], action: int, *, slippery: bool) -> Chances:
    """FrozenLake's rules from its documentation: as likely to either side as ahead, and no way through the border."""
    chances: Chances = {}
    turns = (-1, 0, 1) if slippery else (0,)
    for turn in turns:
        down, right = LAKE_MOVES[LAKE_ACTIONS[(action + turn) % 4]]
        row = min(max(cell[0] + down, 0), len(rows) - 1)
        column = min(max(cell[1] + right, 0), len(rows[0]) - 1)
        chances[row, column] = chances.get((row, column), 0.0) + 1 / len(turns)
    return chances


def lake_chance(rows: list[str], num_sweeps: int) -> float:
    """Value iteration on the slippery lake: the best chance of the goal within so many steps."""
    cells = list(itertools.product(range(len(rows)), range(len(rows[0]))))
    worth = {cell: float(rows[cell[0]][cell[1]] == "G") for cell in cells}
    ways = {cell: [lake(rows, cell, a, slippery=True) for a in range(4)] for cell in cells}
    for _ in range(num_sweeps):
        worth |= {
            cell: max(sum(p * worth[after] for after, p in way.items()) for way in ways[cell])
            for cell in cells
            if rows[cell[0]][cell[1]] in "SF"
        }
    return worth[0, 0]


@pytest.mark.parametrize("slippery", [True, False])
@pytest.mark.parametrize("name", ["4x4", "8x8"])
def test_a_frozen_lake_is_the_one_of_its_documentation(name: str, slippery: bool) -> None:
    rows = MAPS[name]
    mdp = enumerate_world(world_of("FrozenLake-v1", options={"map_name": name, "is_slippery": slippery}))
    assert isinstance(mdp, StochasticMDP if slippery else DeterministicMDP)
    assert mdp.actions == LAKE_ACTIONS
    # Cells behind holes may be out of reach; all the others are states.
    reached, queue = {(0, 0)}, deque([(0, 0)])
    while queue:
        cell = queue.popleft()
        for action in range(4 if rows[cell[0]][cell[1]] in "SF" else 0):
            new = lake(rows, cell, action, slippery=slippery).keys() - reached
            reached |= new
            queue.extend(new)
    assert set(mdp.states) == reached
    for state in range(mdp.num_states):
        label: Any = mdp.states[state]
        row, column = label
        assert mdp.goal[state] == (rows[row][column] == "G")
        assert mdp.terminal[state] == (rows[row][column] in "GH")
        for action in range(0 if mdp.terminal[state] else 4):
            assert chances_after(mdp, state, action) == pytest.approx(
                lake(rows, (row, column), action, slippery=slippery)
            )


def chances_after(mdp: StochasticMDP | DeterministicMDP, state: int, action: int) -> dict[Any, float]:
    if isinstance(mdp, DeterministicMDP):
        return {mdp.states[mdp.next_state[state, action]]: 1.0}
    row = state * mdp.num_actions + action
    places = range(mdp.row_start[row], mdp.row_start[row + 1])
    return {mdp.states[mdp.next_state[place]]: float(mdp.probability[place]) for place in places}


def test_a_lake_may_be_named_by_its_size_too() -> None:
    assert stochastic("FrozenLake8x8-v1").states == stochastic("FrozenLake-v1", map_name="8x8").states


@pytest.mark.parametrize(("name", "lost"), [("4x4", 0.0), ("8x8", 0.11)])
def test_the_plan_for_a_slippery_lake_is_nearly_as_sure_as_the_surest(name: str, lost: float) -> None:
    """The plan weighs time against risk; the surest way of all comes from an independent value iteration."""
    mdp = stochastic("FrozenLake-v1", map_name=name)
    surest = lake_chance(MAPS[name], 3000)
    found = reach_probability(mdp, plan_world(mdp), mdp.goal).values[mdp.start]
    assert found == pytest.approx(surest - lost, abs=0.005)
    patient = reach_probability(mdp, plan_world(mdp, 0.99999), mdp.goal).values[mdp.start]
    assert patient == pytest.approx(surest, abs=1e-4)


def test_the_small_slippery_lake_is_crossed_with_fourteen_chances_in_seventeen() -> None:
    mdp = stochastic("FrozenLake-v1")
    assert reach_probability(mdp, plan_world(mdp), mdp.goal).values[mdp.start] == pytest.approx(14 / 17)


def test_expected_rewards_come_from_the_table() -> None:
    mdp = stochastic("FrozenLake-v1")
    assert mdp.reward == pytest.approx(mdp.goal_chance)
    paid = stochastic("FrozenLake-v1", reward_schedule=[10, -5, -1])
    holes = paid.terminal & ~paid.goal
    chance_of_hole = [
        [sum(p for label, p in chances_after(paid, s, a).items() if holes[paid.index[label]]) for a in range(4)]
        for s in range(paid.num_states)
    ]
    expected = 10 * paid.goal_chance - 5 * np.array(chance_of_hole) - (1 - paid.goal_chance - np.array(chance_of_hole))
    assert paid.reward is not None
    assert paid.reward[~paid.terminal] == pytest.approx(expected[~paid.terminal])


def test_a_lake_whose_goal_is_out_of_reach_does_not_take_a_hole_for_it() -> None:
    world = world_of("FrozenLake-v1", options={"desc": ["SH", "HG"], "is_slippery": False})
    with pytest.raises(ValueError, match=r"no goal can be reached from the start CellState\(row=0, column=0\)"):
        enumerate_world(world)


def test_every_destination_of_the_taxi_has_its_share_of_the_404_reachable_states() -> None:
    found: dict[str, set[Any]] = {}
    for seed in range(20):
        mdp = deterministic("Taxi-v3", seed=seed)
        start: Any = mdp.states[mdp.start]
        found.setdefault(start.destination, set()).update(mdp.states)
    # A taxi somewhere, the passenger at one of the other three stands or inside; and the end.
    assert {len(states) for states in found.values()} == {25 * 4 + 1}
    assert sum(map(len, found.values())) == 404


def taxi_steps(state: int) -> int:
    """Count the steps to the drop-off, by stepping a real taxi through all that it can do."""
    env = TaxiEnv()
    env.reset(seed=0)
    seen, queue = {state}, deque([(state, 0)])
    while True:
        here, steps = queue.popleft()
        for action in range(6):
            env.s = here
            after, _, ended, _, _ = env.step(action)  # type: ignore[no-untyped-call]
            if ended:
                return steps + 1
            if after not in seen:
                seen.add(after)
                queue.append((after, steps + 1))


@pytest.mark.parametrize("seed", range(4))
def test_the_taxi_takes_as_few_steps_as_a_search_of_the_real_one(seed: int) -> None:
    mdp = deterministic("Taxi-v3", seed=seed)
    path = follow(mdp, plan(mdp))
    env = gymnasium.make("Taxi-v4")
    observation, _ = env.reset(seed=seed)
    assert path.num_steps == taxi_steps(int(observation))
    results = [env.step(action) for action in path.actions]
    assert [result[2] for result in results] == [False] * (path.num_steps - 1) + [True]
    assert results[-1][1] == 20
    names = [mdp.actions[action] for action in path.actions]
    assert names.count("pickup") == names.count("dropoff") == 1


def test_the_cliff_is_walked_around_in_thirteen_steps() -> None:
    mdp = deterministic("CliffWalking-v1")
    assert mdp.num_states == 4 * 12 - 10
    path = follow(mdp, plan(mdp))
    assert path.num_steps == 13
    assert [mdp.states[state] for state in path.states[:2]] == [(3, 0), (2, 0)]
    assert mdp.states[path.states[-1]] == (3, 11)
    # Who steps over the edge is back at the start.
    assert mdp.next_state[mdp.index[2, 5], mdp.actions.index("down")] == mdp.start
    assert stochastic("CliffWalking-v1", is_slippery=True).num_states == mdp.num_states


@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        ("FrozenLake-v1", {"is_slippery": False}),
        ("FrozenLake-v1", {"map_name": "8x8"}),
        ("Taxi-v4", {}),
        ("Taxi-v4", {"is_rainy": True}),
        ("CliffWalking-v1", {}),
    ],
)
def test_random_walks_of_the_real_environment_stay_within_the_table(env_id: str, options: dict[str, Any]) -> None:
    world = world_of(env_id, seed=5, options=options)
    assert isinstance(world, TableWorld)
    mdp = enumerate_world(world)
    env: Any = gymnasium.make(env_id, **options).unwrapped
    env.reset(seed=5)
    columns = {"FrozenLake-v1": 8 if options.get("map_name") else 4, "CliffWalking-v1": 12}
    stands = ("red", "green", "yellow", "blue", "in the taxi")

    def label(observation: int) -> Any:  # noqa: ANN401 - a tuple of what the environment has.
        if env_id in columns:
            return divmod(observation, columns[env_id])
        row, column, passenger, destination = env.decode(observation)
        return row, column, stands[passenger], stands[destination]

    rng, state = np.random.default_rng(3), mdp.start
    for action in rng.integers(mdp.num_actions, size=400).tolist():
        observation, _, ended, _, _ = env.step(action)
        assert label(int(observation)) in chances_after(mdp, state, action)
        state = mdp.index[label(int(observation))]
        assert ended == mdp.terminal[state]
        if ended:
            env.reset(seed=5)
            state = mdp.start


def test_states_are_put_into_words() -> None:
    lake_world, taxi, cliff = (world_of(name) for name in ("FrozenLake-v1", "Taxi-v3", "CliffWalking-v1"))
    assert describe_state(lake_world, enumerate_world(lake_world).states[-1]) == "row 3, column 3: the goal"
    riding, waiting = TaxiState(2, 3, "in the taxi", "green"), TaxiState(0, 4, "blue", "red")
    assert describe_state(taxi, riding) == "taxi in row 2, column 3, passenger in it, bound for green"
    assert describe_state(taxi, waiting) == "taxi in row 0, column 4, passenger at the blue stand, bound for red"
    assert describe_state(cliff, cliff.start) == "row 3, column 0"


def test_actions_can_be_chosen_by_name() -> None:
    mdp = enumerate_world(world_of("CliffWalking-v1", actions=("right", "up", "down")))
    assert mdp.actions == ("right", "up", "down")
    with pytest.raises(ValueError, match="'jump' is no action of this world; it has up, right, down, left"):
        world_of("CliffWalking-v1", actions=("jump",))


class LyingLake(FrozenLakeEnv):
    """Its table speaks of dry ground, its steps slip."""

    def __init__(self) -> None:
        super().__init__(is_slippery=False)

    def step(self, a: int) -> Any:  # noqa: ANN401 - Gymnasium's signature.
        return super().step((a + 1) % 4)  # type: ignore[no-untyped-call]


def test_a_table_that_is_not_what_steps_do_is_refused() -> None:
    with pytest.raises(NotFinite, match=r"lake holds a table P that is not what its steps do: '.*' in CellState"):
        TableWorld(LyingLake(), 0, "lake")
    with pytest.raises(NotFinite, match="a fickle passenger keeps a memory that its table leaves out"):
        world_of("Taxi-v3", options={"fickle_passenger": True})


class Trap(gymnasium.Env[Any, Any]):
    """Ends in a pit, while the end that pays lies beyond it."""

    observation_space, action_space = gymnasium.spaces.Discrete(3), gymnasium.spaces.Discrete(1)
    P: ClassVar[Any] = [[[(1.0, 1, 0.0, True)]], [[(1.0, 2, 1.0, True)]], [[(1.0, 2, 0.0, True)]]]

    def reset(self, **_: Any) -> Any:  # noqa: ANN401 - Gymnasium's signature.
        return 0, {}

    def step(self, _: int) -> Any:  # noqa: ANN401 - as above.
        return 1, 0.0, True, False, {}


def test_a_better_end_elsewhere_in_the_table_says_that_the_one_in_reach_is_no_goal() -> None:
    world = TableWorld(Trap(), 0, "trap")
    assert (world.actions, world.start, world.describe(1)) == (("action 0",), 0, "state 1")
    with pytest.raises(ValueError, match="the best end in reach pays 0, and a goal pays 1 or more"):
        enumerate_world(world)


@pytest.mark.parametrize(
    ("env_id", "options", "problem"),
    [
        ("FrozenLak-v1", {}, "no environment 'FrozenLak-v1'; did you mean FrozenLake-v1"),
        ("MiniGrid-Doorkey-6x6-v0", {}, "did you mean MiniGrid-DoorKey-6x6-v0"),
        ("???", {}, r"no environment '\?\?\?'; one of your own is named module:callable"),
        ("Taxi-v9", {}, "no environment 'Taxi-v9'; did you mean Taxi-v4"),
        ("FrozenLake-v1", {"map_name": "9x9"}, "FrozenLake-v1 cannot be made with map_name='9x9': KeyError: '9x9'"),
        ("FrozenLake-v1", {"size": 3}, "cannot be made with size=3: TypeError"),
        ("LunarLander-v3", {}, "LunarLander-v3 cannot be made: DependencyNotInstalled: Box2D"),
        ("CartPole-v1", {}, r"CartPole-v1 has continuous observations, Box\(.*abstract them.*own-environment.md"),
        ("MountainCar-v0", {}, "continuous observations"),
        ("Pendulum-v1", {}, "continuous observations"),
        ("Blackjack-v1", {}, "draws random numbers"),
    ],
)
def test_what_cannot_be_taken_in_is_told_in_one_message(env_id: str, options: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem) as caught:
        world_of(env_id, options=options)
    assert "\n" not in str(caught.value)


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="the seed must be 0 or larger, not -1"):
        world_of("FrozenLake-v1", seed=-1)


def test_a_version_that_is_gone_stands_for_the_newest() -> None:
    assert resolve_id("Taxi-v3") == "Taxi-v4"
    assert resolve_id("FrozenLake") == "FrozenLake-v1"
    assert resolve_id("MiniGrid-LavaGapS5-v0") == "MiniGrid-LavaGapS5-v0"
    assert world_of("CliffWalking-v0").name == "CliffWalking-v1"  # type: ignore[attr-defined]


def test_options_are_read_as_json_where_they_are_json() -> None:
    texts = ["map_name=8x8", "is_slippery=false", "success_rate=0.5", "desc=null", 'who="me"', "sum=a=b", "empty="]
    assert parse_options(texts) == {
        "map_name": "8x8",
        "is_slippery": False,
        "success_rate": 0.5,
        "desc": None,
        "who": "me",
        "sum": "a=b",
        "empty": "",
    }


@pytest.mark.parametrize(
    ("texts", "problem"),
    [
        (["slippery"], "written KEY=VALUE, such as is_slippery=false, not 'slippery'"),
        (["=3"], "written KEY=VALUE"),
        (["a-b=3"], "written KEY=VALUE"),
        (["a=1", "a=2"], "the option 'a' of the environment is given twice"),
    ],
)
def test_options_that_are_none_are_refused(texts: list[str], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        parse_options(texts)


def test_key_door_maps_load_no_environment() -> None:
    import subprocess  # noqa: PLC0415 - only this test starts a process.
    import sys  # noqa: PLC0415 - as above.

    code = (
        "import sys\n"
        "import webapp.explainer.on_demand, webapp.explainer.stochastic_planning\n"
        "import webapp.explainer.worlds.enumeration, webapp.explainer.worlds.finite\n"
        "print(sorted({'gymnasium', 'minigrid', 'scipy', 'torch'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT)
    assert run.stdout.strip() == "[]"
