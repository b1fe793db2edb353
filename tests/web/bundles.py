"""A bundle of the shipped study, written by hand in the format that `Catalogue` reads; a picture is one pixel.

Every layout of the study is the same small world here, so that a test can drive through it in seven actions:

    #######      The agent begins at `<`, facing the key. Its way: pickup, left, left, forward, toggle, forward,
    #K<.DG#      forward; its subgoals by our decree: it takes the key (1), opens the door (5), reaches the goal (7).
    #######      A video stops at step 3.
"""

import hashlib
import json
import shutil
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from webapp.explainer.explanation import Strip, kind_strips
from webapp.explainer.solvers import follow, plan
from webapp.explainer.tie_breaking import shortest_path_actions
from webapp.explainer.worlds.key_door import ACTIONS, tabulate
from webapp.explainer.worlds.layout import parse_layout
from webapp.stimuli.catalogue import CATALOGUE_FORMAT, bundle_version
from webapp.stimuli.program import running_program
from webapp.study.experiments import TAILORED_KINDS, Experiment, Kind
from webapp.study.protocol import Study, parse_study
from webapp.study.texts import parse_texts

STUDY_FOLDER = Path(__file__).parents[2] / "webapp" / "studies" / "sakai2021"
FILLED_IN = {"contact": "office@example.org", "ethics_approval": "Committee, 1", "retention_until": "2031-12-31"}

SMALL_WORLD = tabulate(parse_layout("#######\n#K<.DG#\n#######"))
POLICY = plan(SMALL_WORLD)
PATH = follow(SMALL_WORLD, POLICY)
WAY = tuple(ACTIONS[action] for action in PATH.actions)
"""The names of the actions that lead from the start to the goal."""
SUBGOALS = (1, 5, 7)
VIDEO_STOPS = 3
"""The step at which the question of an experiment with a video is asked."""


def read_study(**changes: object) -> Study:
    study = parse_study((STUDY_FOLDER / "study.toml").read_text(encoding="utf-8"))
    return study.model_copy(update=changes)


def write_bundle(instance: Path, study: Study, sources: Mapping[str, bytes] | None = None) -> str:
    """Write a bundle and let it be the current and the published one; return its version.

    The picture of a state has the state's number, and the words `View <number>.`. Sources are the frozen files of the
    study's folder.
    """
    bundles = instance / "bundles"
    draft = bundles / "draft"
    for part in ("pictures", "tables"):
        (draft / part).mkdir(parents=True)
    states = range(SMALL_WORLD.num_states)
    content = {
        "format": CATALOGUE_FORMAT,
        "study": study.model_dump(mode="json"),
        "texts": {language: _texts(language) for language in study.languages},
        "pictures": {
            "digests": [_write_picture(draft / "pictures", shade) for shade in states],
            "alts": {language: [f"View {number}." for number in states] for language in study.languages},
        },
        "actions": list(ACTIONS),
        "trials": {experiment.id: _trials(study, experiment) for experiment in study.experiments},
    }
    (draft / "catalogue.json").write_text(json.dumps(content), encoding="utf-8")
    for layout in study.layouts:
        (draft / "tables" / f"{layout}.json").write_text(json.dumps(_table(study)), encoding="utf-8")
    manifest = {"study": study.name, "program": running_program().to_json()}
    (draft / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    for name, source in (sources or {}).items():
        (draft / "sources" / "study" / name).parent.mkdir(parents=True, exist_ok=True)
        (draft / "sources" / "study" / name).write_bytes(source)
    version = bundle_version(draft)
    if (bundles / version).exists():
        shutil.rmtree(draft)
    else:
        draft.rename(bundles / version)
    for pointer in ("current", "published"):
        (bundles / f"{pointer}-{study.name}").write_text(version, encoding="ascii")
    return version


def _texts(language: str) -> dict[str, object]:
    sources = [folder / "texts" / f"{language}.toml" for folder in (STUDY_FOLDER.parent, STUDY_FOLDER)]
    entries: dict[str, object] = {}
    for source in sources:
        if source.exists():
            entries |= parse_texts(source.read_text(encoding="utf-8"), language, source.name).entries
    return {key: list(entry) if isinstance(entry, tuple) else entry for key, entry in entries.items()}


def _table(study: Study) -> dict[str, Any]:
    return {
        "actions": list(ACTIONS),
        "next_state": SMALL_WORLD.next_state.tolist(),
        "terminal": SMALL_WORLD.terminal.tolist(),
        "goal": SMALL_WORLD.goal.tolist(),
        "start": SMALL_WORLD.start,
        "pictures": list(range(SMALL_WORLD.num_states)),
        "policy": POLICY.tolist(),
        "path": {"states": list(PATH.states), "actions": list(PATH.actions)},
        "subgoals": list(SUBGOALS),
        "sentences": {
            language: [f"Step {step} in {language}: {action}." for step, action in enumerate(WAY, start=1)]
            for language in study.languages
        },
    }


def _trials(study: Study, experiment: Experiment) -> dict[str, Any]:
    has_video = experiment.situation == "video"
    step = VIDEO_STOPS if has_video else 1
    ahead = [subgoal for subgoal in SUBGOALS if subgoal >= step]
    _, *pairs = kind_strips("subgoals", PATH, ahead, step)
    trial = {
        "from_step": step,
        "situation": {
            "current": PATH.states[step - 1],
            "video": _strip(Strip(PATH.states[:step], PATH.actions[: step - 1])) if has_video else None,
            "announced": list(PATH.actions[step - 1 : step + 1]) if has_video else [],
        },
        "explanations": {
            kind: [_explanation(kind, step)] * (study.explanation.num_draws if kind == "random" else 1)
            for kind in experiment.kinds
            if kind not in TAILORED_KINDS
        },
        "pairs": {str(subgoal): _strip(pair) for subgoal, pair in zip(ahead, pairs, strict=True)},
        "probes": _probes(experiment, step),
    }
    return dict.fromkeys(experiment.layouts, trial)


def _explanation(kind: Kind, step: int) -> list[dict[str, Any]]:
    """Return the whole way, the current view once or four times, or the current view and the last two subgoals."""
    current = Strip((PATH.states[step - 1],))
    match kind:
        case "full":
            strips = kind_strips("full", PATH, (), step)
        case "none":
            strips = (current,)
        case "placebic":
            strips = (current,) * 4
        case "first_key_point":
            strips = kind_strips("first_key_point", PATH, (5, 7), step)
        case _:
            strips = kind_strips("subgoals", PATH, (5, 7), step)
    return [_strip(strip) for strip in strips]


def _strip(strip: Strip) -> dict[str, Any]:
    return {"frames": list(strip.states), "actions": list(strip.actions)}


def _probes(experiment: Experiment, step: int) -> list[dict[str, Any]]:
    """Ask about the states of the path after the current one, in order, whatever the experiment says of where."""
    num_questions = 0 if experiment.probe is None else experiment.probe.num_questions
    optimal = shortest_path_actions(SMALL_WORLD)
    return [
        {"state": state, "action": action, "as_good": optimal[state].nonzero()[0].tolist()}
        for state, action in PATH.pairs[step : step + num_questions]
    ]


def _write_picture(folder: Path, shade: int) -> str:
    header = struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes((0, shade)))), (b"IEND", b""))
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    digest = hashlib.sha256(png).hexdigest()
    (folder / f"{digest}.png").write_bytes(png)
    return digest
