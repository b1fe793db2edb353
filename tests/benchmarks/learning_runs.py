"""Compare agents that learn in one stack with stable-baselines3's DQN: how fast they learn, and how many succeed.

python -m tests.benchmarks.learning_runs [--agents 32] [--peers 8]

Both live on the map `simulation` with the settings that `FreshSettings` has by default, in one thread.

- Speed is actions of agents per second of the processor's time, learning included, by turns and as medians. Each agent
  lives through as many actions in either way, 7,680, with the share of random actions falling as it does over a run
  that uses its whole budget (the peer asks its network only where it does not act at random, so at the start of a run
  it is faster than later). What a first call loads is loaded before. Our agents are paid for standing still, so that
  none becomes optimal and leaves its slot to nobody.
- Success is that the greedy policy takes a shortest path from the start, looked at after every episode. There is no
  sub-reward. Whoever has not succeeded after `max_episodes` episodes has failed.

The peer differs in what it is, not in how it is set: its first layer begins with smaller weights, its actions before
the first update are all random, and it looks at MiniGrid where we look at a table.
"""

import os

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # Before NumPy and torch are loaded.

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from tests.worlds import LAYOUTS
from webapp.explainer.learning import FreshAgent, FreshSettings, learn
from webapp.explainer.mdp import StateAction
from webapp.explainer.solvers import distances_to_goal
from webapp.explainer.worlds.environment import KeyDoorEnv
from webapp.explainer.worlds.key_door import TOGGLE, tabulate

LAYOUT = LAYOUTS["simulation"]
MAX_STEPS = 10 * LAYOUT.width * LAYOUT.height
SETTINGS = FreshSettings()
PROMISED_RATIO = 15.0
TURNS = 5
NUM_TIMED_EPISODES = 12
TIMED = replace(
    SETTINGS,
    max_episodes=NUM_TIMED_EPISODES,
    exploration_steps=SETTINGS.exploration_steps * NUM_TIMED_EPISODES // SETTINGS.max_episodes,
)
"""A short run in which exploration falls as in a long one."""
STANDING_STILL: StateAction = (tabulate(LAYOUT).start, TOGGLE)
"""There is no door ahead of the start."""


@dataclass(frozen=True)
class Ended:
    """How the learning of one agent ended, ours or the peer's."""

    num_episodes: int
    is_optimal: bool


class StopWhenOptimal(BaseCallback):
    """Looks at the peer's greedy policy after every episode."""

    def __init__(self) -> None:
        super().__init__()
        self._env = KeyDoorEnv(LAYOUT)
        mdp = tabulate(LAYOUT)
        self._shortest = int(distances_to_goal(mdp)[mdp.start])
        self.ended = Ended(0, is_optimal=False)

    def _on_step(self) -> bool:
        if self.locals["dones"][0]:
            self.ended = Ended(self.ended.num_episodes + 1, self._takes_a_shortest_path())
        return not self.ended.is_optimal and self.ended.num_episodes < SETTINGS.max_episodes

    def _takes_a_shortest_path(self) -> bool:
        observation, _ = self._env.reset()
        arrives = False
        for _ in range(self._shortest):
            action, _ = self.model.predict(observation, deterministic=True)
            observation, _, arrives, _, _ = self._env.step(int(action))
        return arrives


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what was measured and what was promised, and return 0 if both promises are kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=32, help="so many of ours learn until they succeed or fail")
    parser.add_argument("--peers", type=int, default=8, help="so many of the peer's do")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    kept = [compare_speed(), compare_success(options.agents, options.peers)]
    return 0 if all(kept) else 1


def compare_speed() -> bool:
    """Time both by turns and print actions per second."""
    ways = {f"ours, {SETTINGS.num_slots} slots": live_in_a_stack, "stable-baselines3": live_as_a_peer}
    rates: dict[str, list[float]] = {name: [] for name in ways}
    learn(LAYOUT, [FreshAgent("warm-up")], replace(SETTINGS, max_episodes=2), 0)
    peer(0, 2 * MAX_STEPS).learn(2 * MAX_STEPS)
    for turn in range(TURNS):
        for name, live in ways.items():
            rates[name].append(_actions_per_second(live, turn))
    ours, theirs = (statistics.median(each) for each in rates.values())
    print(f"{NUM_TIMED_EPISODES * MAX_STEPS} actions of each agent, medians of {TURNS} turns:")
    for name, each in rates.items():
        print(f"  {name:36} {statistics.median(each):9.0f} actions per second")
    return _verdict(
        f"  {'ratio':36} {ours / theirs:9.1f}", f"{PROMISED_RATIO:.0f}", kept=ours / theirs >= PROMISED_RATIO
    )


def live_in_a_stack(turn: int) -> int:
    """Let our agents live, one in each slot, and return how many actions they took."""
    agents = [FreshAgent(f"agent {number}", (STANDING_STILL,)) for number in range(SETTINGS.num_slots)]
    outcomes = learn(LAYOUT, agents, TIMED, turn)
    if any(outcome.is_optimal for outcome in outcomes):
        raise AssertionError("an agent has left its slot early, so that the stack was not full")
    return sum(outcome.num_steps for outcome in outcomes)


def live_as_a_peer(turn: int) -> int:
    """Let one of the peer's agents live, and return how many actions it took."""
    num_steps = NUM_TIMED_EPISODES * MAX_STEPS
    peer(turn, num_steps, TIMED).learn(num_steps)
    return num_steps


def peer(seed: int, num_steps: int, settings: FreshSettings = SETTINGS) -> DQN:
    """Make an agent of stable-baselines3 with such settings, that is about to take so many actions."""
    model = DQN(
        "MlpPolicy",
        KeyDoorEnv(LAYOUT),
        learning_rate=settings.learning_rate,
        buffer_size=settings.replay_capacity,
        learning_starts=settings.warmup_steps,
        batch_size=settings.batch_size,
        tau=1.0,
        gamma=settings.discount,
        train_freq=settings.train_interval,
        gradient_steps=1,
        target_update_interval=settings.target_interval,
        exploration_fraction=settings.exploration_steps / num_steps,
        exploration_initial_eps=1.0,
        exploration_final_eps=settings.final_exploration,
        max_grad_norm=settings.max_gradient_norm,
        policy_kwargs={"net_arch": [settings.units, settings.units]},
        seed=seed,
        device="cpu",
    )
    # Its own logger leaves an empty folder behind.
    model.set_logger(Logger(folder=None, output_formats=[]))
    return model


def compare_success(num_agents: int, num_peers: int) -> bool:
    """Let agents of both learn until they succeed or fail, and print the shares."""
    outcomes = learn(LAYOUT, [FreshAgent(f"agent {number}") for number in range(num_agents)], SETTINGS, 0)
    ours = [Ended(outcome.num_episodes, outcome.is_optimal) for outcome in outcomes]
    theirs = []
    for number in range(num_peers):
        theirs.append(_life_of_a_peer(number))
        print(f"  peer {number + 1} of {num_peers}: {theirs[-1]}", flush=True)
    print(f"a shortest path within {SETTINGS.max_episodes} episodes:")
    for name, ended in (("ours", ours), ("stable-baselines3", theirs)):
        num_optimal = sum(each.is_optimal for each in ended)
        median = statistics.median(each.num_episodes for each in ended)
        print(f"  {name:36} {num_optimal:4} of {len(ended):3}   median {median:.1f} episodes")
    share, peers_share = (statistics.mean(each.is_optimal for each in ended) for ended in (ours, theirs))
    return _verdict(f"  {'share':36} {share:9.2f}", f"at least {peers_share:.2f}", kept=share >= peers_share)


def _life_of_a_peer(seed: int) -> Ended:
    num_steps = SETTINGS.max_episodes * MAX_STEPS
    watch = StopWhenOptimal()
    peer(seed, num_steps).learn(num_steps, callback=watch)
    return watch.ended


def _actions_per_second(live: Callable[[int], int], turn: int) -> float:
    began = time.process_time()
    num_actions = live(turn)
    return num_actions / (time.process_time() - began)


def _verdict(measured: str, promised: str, *, kept: bool) -> bool:
    print(f"{measured}   promised {promised}   {'kept' if kept else 'BROKEN'}", flush=True)
    return kept


if __name__ == "__main__":
    sys.exit(main())
