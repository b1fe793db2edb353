"""The parts of a bundle as plain JSON: what the pages show, and a table for each layout."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from webapp.explainer.explanation import Strip
from webapp.explainer.pictures.sentences import sentence
from webapp.explainer.subgoals import importance_threshold
from webapp.explainer.worlds.key_door import ACTIONS, key_door_state
from webapp.stimuli.agents import Agent
from webapp.stimuli.catalogue import CATALOGUE_FORMAT
from webapp.stimuli.pictures import Album
from webapp.stimuli.scenes import Scene, Walk
from webapp.stimuli.sources import Sources


def canonical_json(content: object) -> bytes:
    """Write JSON so that equal content gives equal bytes: keys sorted, UTF-8, one line."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return (text + "\n").encode()


def catalogue_content(sources: Sources, scenes: Mapping[str, Mapping[str, Scene]], album: Album) -> dict[str, Any]:
    """Return the content of `catalogue.json`, which `stimuli.catalogue` reads.

    Pictures and actions are numbers into its lists, so that a worker keeps each text once.

    Args:
        sources: The study.
        scenes: By experiment and layout.
        album: The pictures.
    """
    actions = _all_actions(sources)
    return {
        "format": CATALOGUE_FORMAT,
        "study": sources.study.model_dump(mode="json"),
        "texts": {language: texts.entries for language, texts in sources.texts.items()},
        "actions": actions,
        "pictures": {"digests": list(album.digests), "alts": album.alts},
        "trials": {
            experiment: {
                layout: _trial(scene, album.numbers[layout], _action_numbers(sources, layout, actions))
                for layout, scene in by_layout.items()
            }
            for experiment, by_layout in scenes.items()
        },
    }


def _all_actions(sources: Sources) -> tuple[str, ...]:
    """Return the names of all actions of the study, those of key-door layouts first."""
    own = (action for world in sources.worlds.values() for action in world.table.actions)
    return tuple(dict.fromkeys((*(ACTIONS if sources.layouts else ()), *own)))


def _action_numbers(sources: Sources, layout: str, actions: Sequence[str]) -> tuple[int, ...]:
    """Return the number in the study's list of each action of a layout's world."""
    names = sources.worlds[layout].table.actions if layout in sources.worlds else ACTIONS
    return tuple(actions.index(name) for name in names)


def table_content(sources: Sources, name: str, agent: Agent, way: Walk, numbers: tuple[int, ...]) -> dict[str, Any]:
    """Return the content of `tables/<layout>.json`: the world as the agent knows it, its policy, path and importance.

    Args:
        sources: The study.
        name: The layout's name.
        agent: Whose world and policy it is.
        way: Its path.
        numbers: The picture of each state `[S]`.
    """
    world = agent.world
    return {
        **(_own_world(sources, name, way) if name in sources.worlds else _key_door_world(sources, name, agent, way)),
        "actions": world.actions,
        "next_state": world.next_state.tolist(),
        "terminal": world.terminal.tolist(),
        "goal": world.goal.tolist(),
        "start": world.start,
        "pictures": numbers,
        "policy": agent.policy(world).tolist(),
        "path": {"states": way.path.states, "actions": way.path.actions},
        "importance": way.importance.values.tolist(),
        "threshold": importance_threshold(way.importance.values),
        "subgoals": way.subgoals,
    }


def _key_door_world(sources: Sources, name: str, agent: Agent, way: Walk) -> dict[str, Any]:
    world, layout = agent.world, sources.layouts[name]
    return {
        "map": str(layout),
        "states": list(world.states),
        "sentences": {
            language: [
                sentence(layout, key_door_state(world, state), action, step, phrases)
                for step, (state, action) in enumerate(way.path.pairs, start=1)
            ]
            for language, phrases in sources.step_phrases.items()
        },
    }


def _own_world(sources: Sources, name: str, way: Walk) -> dict[str, Any]:
    """Return the same of a world of the study's own: where it came from, labels, each step in words of its own."""
    world = sources.worlds[name]
    return {
        "map": world.origin.use,
        "states": [world.label(state) for state in range(world.table.num_states)],
        "sentences": {
            language: [
                f"{texts(f'actions.{world.table.actions[action]}')}: {world.describe(state, language)}"
                for state, action in way.path.pairs
            ]
            for language, texts in sources.texts.items()
        },
    }


def _trial(scene: Scene, numbers: tuple[int, ...], actions: tuple[int, ...]) -> dict[str, Any]:
    """Write down what an experiment shows of a layout.

    Args:
        scene: It.
        numbers: The picture of each state `[S]`.
        actions: The number of each action `[A]`.
    """
    strip = partial(_strip, numbers=numbers, actions=actions)
    return {
        "from_step": scene.from_step,
        "situation": {
            "current": numbers[scene.current],
            "video": None if scene.video is None else strip(scene.video),
            "announced": [actions[action] for action in scene.announced],
        },
        "explanations": {
            kind: [[strip(shown) for shown in strips] for strips in variants]
            for kind, variants in scene.explanations.items()
        },
        "pairs": {str(step): strip(pair) for step, pair in scene.pairs.items()},
        "probes": [
            {
                "state": prediction.state,
                "action": actions[prediction.action],
                "as_good": [actions[action] for action in prediction.as_good],
            }
            for prediction in scene.predictions
        ],
    }


def _strip(strip: Strip, numbers: tuple[int, ...], actions: tuple[int, ...]) -> dict[str, Any]:
    return {
        "frames": [numbers[state] for state in strip.states],
        "actions": [actions[action] for action in strip.actions],
    }
