"""The parts of a bundle as plain JSON: what the pages show, and a table for each layout."""

import json
from collections.abc import Mapping
from dataclasses import asdict
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
    return {
        "format": CATALOGUE_FORMAT,
        "study": sources.study.model_dump(mode="json"),
        "texts": {language: texts.entries for language, texts in sources.texts.items()},
        "actions": ACTIONS,
        "pictures": {"digests": list(album.files), "alts": album.alts},
        "trials": {
            experiment: {layout: _trial(scene, album.numbers[layout]) for layout, scene in by_layout.items()}
            for experiment, by_layout in scenes.items()
        },
    }


def table_content(sources: Sources, name: str, agent: Agent, way: Walk, numbers: tuple[int, ...]) -> dict[str, Any]:
    """Return the content of `tables/<layout>.json`: the world as the agent knows it, its policy, path and importance.

    Args:
        sources: The study.
        name: The layout's name.
        agent: Whose world and policy it is.
        way: Its path.
        numbers: The picture of each state `[S]`.
    """
    world, layout = agent.world, sources.layouts[name]
    return {
        "map": str(layout),
        "states": list(world.states),
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
        "sentences": {
            language: [
                sentence(layout, key_door_state(world, state), action, step, phrases)
                for step, (state, action) in enumerate(way.path.pairs, start=1)
            ]
            for language, phrases in sources.step_phrases.items()
        },
    }


def _trial(scene: Scene, numbers: tuple[int, ...]) -> dict[str, Any]:
    return {
        "from_step": scene.from_step,
        "situation": {
            "current": numbers[scene.current],
            "video": None if scene.video is None else _strip(scene.video, numbers),
            "announced": scene.announced,
        },
        "explanations": {
            kind: [[_strip(strip, numbers) for strip in strips] for strips in variants]
            for kind, variants in scene.explanations.items()
        },
        "pairs": {str(step): _strip(strip, numbers) for step, strip in scene.pairs.items()},
        "probes": [asdict(prediction) for prediction in scene.predictions],
    }


def _strip(strip: Strip, numbers: tuple[int, ...]) -> dict[str, Any]:
    return {"frames": [numbers[state] for state in strip.states], "actions": strip.actions}
