from dataclasses import replace

import numpy as np
import pytest

from tests.worlds import LAYOUTS, reachable_states
from webapp.explainer.learning import TrainingSettings
from webapp.explainer.learning.encoding import NUM_ACTIONS, Encoding
from webapp.explainer.learning.exploration import Explorer
from webapp.explainer.learning.replay import Experience, Replay
from webapp.explainer.seeding import stream
from webapp.explainer.worlds.key_door import KeyDoorState, start_state, step

LAYOUT = LAYOUTS["experiment1-c"]
ENCODING = Encoding.of(LAYOUT)
NUM_STEPS = 1500
SETTINGS = TrainingSettings(
    num_environments=4,
    num_exploring_environments=2,
    num_warmup_steps=NUM_STEPS,
    cycle_iterations=1,
    max_episode_steps=30,
    least_tried_share=0.5,
)


def explore(settings: TrainingSettings = SETTINGS, seed: int = 0) -> tuple[Explorer, Experience]:
    replay = Replay(ENCODING.num_codes * NUM_ACTIONS, settings)
    explorer = Explorer(LAYOUT, ENCODING, replay, settings, stream(seed))
    for _ in range(NUM_STEPS):
        explorer.act(np.zeros(settings.num_environments, dtype=np.int64))
    rows, environments = np.indices((NUM_STEPS, settings.num_environments))
    return explorer, replay.at(rows, environments)


@pytest.fixture(scope="module")
def explored() -> tuple[Explorer, Experience]:
    return explore()


def state_of(code: int) -> KeyDoorState:
    return KeyDoorState(*ENCODING.states[code].tolist())


def test_what_is_remembered_is_what_the_rules_of_the_world_say(explored: tuple[Explorer, Experience]) -> None:
    _, seen = explored
    columns = (seen.pairs, seen.next_codes, seen.rewards, seen.terminated)
    for pair, after, reward, terminated in zip(*(column.ravel().tolist() for column in columns), strict=True):
        expected, ends = step(LAYOUT, state_of(pair // NUM_ACTIONS), pair % NUM_ACTIONS)
        assert (state_of(after), terminated, reward) == (expected, ends, float(ends))


def test_within_an_episode_each_transition_begins_where_the_last_one_ended(
    explored: tuple[Explorer, Experience],
) -> None:
    _, seen = explored
    begins = seen.pairs[1:] // NUM_ACTIONS
    goes_on = ~seen.first[1:]
    np.testing.assert_array_equal(begins[goes_on], seen.next_codes[:-1][goes_on])
    assert np.all(seen.first[1:][seen.terminated[:-1]])


def test_no_episode_is_longer_than_the_settings_allow(explored: tuple[Explorer, Experience]) -> None:
    _, seen = explored
    for environment in range(SETTINGS.num_environments):
        begins = np.flatnonzero(seen.first[:, environment])
        assert np.diff(begins).max() == SETTINGS.max_episode_steps


def test_at_most_half_of_the_episodes_begin_in_a_visited_state_and_no_other_state(
    explored: tuple[Explorer, Experience],
) -> None:
    explorer, seen = explored
    visited: set[int] = set()
    elsewhere = 0
    for row in range(NUM_STEPS):
        codes = seen.pairs[row] // NUM_ACTIONS
        for code in codes[seen.first[row]].tolist():
            if state_of(code) != start_state(LAYOUT):
                elsewhere += 1
                assert code in visited
        visited |= set(codes.tolist())
    assert 0.4 * explorer.num_episodes < elsewhere <= explorer.num_visited_starts <= 0.5 * explorer.num_episodes
    assert explorer.num_episodes >= seen.first.sum()


def test_rarely_tried_actions_and_starts_in_visited_states_widen_what_is_seen(
    explored: tuple[Explorer, Experience],
) -> None:
    _, seen = explored
    _, without = explore(replace(SETTINGS, least_tried_share=0.0, visited_start_share=0.0))
    num_pairs = NUM_ACTIONS * sum((state.x, state.y) != LAYOUT.goal for state in reachable_states(LAYOUT))
    assert len(np.unique(seen.pairs)) > 0.65 * num_pairs
    assert len(np.unique(without.pairs)) < 0.5 * num_pairs


def test_environments_that_do_not_only_explore_mostly_take_the_greedy_action(
    explored: tuple[Explorer, Experience],
) -> None:
    _, seen = explored
    shares = (seen.pairs % NUM_ACTIONS == 0).mean(axis=0)
    assert shares[0] < 0.35
    assert shares[1] < 0.35
    assert shares[2] > 0.5
    assert shares[3] > 0.85


def test_all_episodes_may_be_made_to_begin_at_the_start() -> None:
    explorer, seen = explore(replace(SETTINGS, visited_start_share=0.0))
    assert explorer.num_visited_starts == 0
    starts = {state_of(code) for code in (seen.pairs // NUM_ACTIONS)[seen.first].tolist()}
    assert starts == {start_state(LAYOUT)}


def test_each_seed_explores_in_its_own_way_and_always_the_same(explored: tuple[Explorer, Experience]) -> None:
    _, seen = explored
    np.testing.assert_array_equal(explore()[1].pairs, seen.pairs)
    assert not np.array_equal(explore(seed=1)[1].pairs, seen.pairs)
