"""A bundle of the shipped study, written by hand in the format that `Catalogue` reads; a picture is one pixel."""

import hashlib
import json
import shutil
import struct
import zlib
from pathlib import Path
from typing import Any

from webapp.explainer.worlds.key_door import ACTIONS
from webapp.stimuli.catalogue import CATALOGUE_FORMAT, bundle_version
from webapp.study.protocol import Experiment, Study, parse_study
from webapp.study.texts import parse_texts

STUDY_FOLDER = Path(__file__).parents[2] / "webapp" / "studies" / "sakai2021"
FILLED_IN = {"contact": "office@example.org", "ethics_approval": "Committee, 1", "retention_until": "2031-12-31"}


def read_study(**changes: object) -> Study:
    study = parse_study((STUDY_FOLDER / "study.toml").read_text(encoding="utf-8"))
    return study.model_copy(update=changes)


def write_bundle(instance: Path, study: Study) -> str:
    """Write a bundle and let it be the current one; return its version."""
    bundles = instance / "bundles"
    draft = bundles / "draft"
    (draft / "pictures").mkdir(parents=True)
    digests = [_write_picture(draft / "pictures", shade) for shade in range(8)]
    content = {
        "format": CATALOGUE_FORMAT,
        "study": study.model_dump(mode="json"),
        "texts": {"en": _texts()},
        "pictures": {"digests": digests, "alts": {"en": [f"View {number}." for number in range(8)]}},
        "actions": list(ACTIONS),
        "trials": {experiment.id: _trials(study, experiment) for experiment in study.experiments},
    }
    (draft / "catalogue.json").write_text(json.dumps(content), encoding="utf-8")
    version = bundle_version(draft)
    if (bundles / version).exists():
        shutil.rmtree(draft)
    else:
        draft.rename(bundles / version)
    (bundles / f"current-{study.name}").write_text(version, encoding="ascii")
    return version


def _texts() -> dict[str, object]:
    source = STUDY_FOLDER / "texts" / "en.toml"
    entries = parse_texts(source.read_text(encoding="utf-8"), "en", source.name).entries
    return {key: list(entry) if isinstance(entry, tuple) else entry for key, entry in entries.items()}


def _trials(study: Study, experiment: Experiment) -> dict[str, Any]:
    video = None if experiment.situation == "current_view" else {"frames": [0, 1, 2], "actions": [1, 0]}
    situation = {"current": 0, "video": video, "announced": [] if video is None else [0, 2]}
    explanation = [{"frames": [0], "actions": []}, {"frames": [3, 4], "actions": [3]}]
    variants = {
        kind: [explanation] * (study.explanation.num_draws if kind == "random" else 1) for kind in experiment.kinds
    }
    return {layout: {"situation": situation, "explanations": variants} for layout in experiment.layouts}


def _write_picture(folder: Path, shade: int) -> str:
    header = struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes((0, shade * 30)))), (b"IEND", b""))
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    digest = hashlib.sha256(png).hexdigest()
    (folder / f"{digest}.png").write_bytes(png)
    return digest
