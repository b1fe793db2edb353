"""Proof that a bundle follows from the files within it: everything is built again from them and compared.

The weights are those of the bundle unless they are to be trained again. Training takes minutes, and gives the same
bytes only with the same packages on the same type of processor; what participants were shown follows from the weights,
so stored ones are the proof that works anywhere, and training again is the further proof for whoever has the machine.
"""

import hashlib
import json
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from webapp.stimuli.agents import Agent, AgentProvider, Agents, BuildError, ReportProgress, planner_agents
from webapp.stimuli.build import build
from webapp.stimuli.catalogue import BundleError, bundle_version
from webapp.stimuli.frozen_files import SHARED, SOURCES, STUDY
from webapp.stimuli.learned import WEIGHTS, learned_agents
from webapp.stimuli.program import running_program
from webapp.stimuli.publication import MANIFEST, program_of
from webapp.stimuli.sources import Sources
from webapp.study.problems import StudyError

Weights = Literal["stored", "train"]

PARTS: Mapping[str, str] = {
    "pictures": "pictures",
    "catalogue": "what is shown",
    "tables": "worlds and paths",
    "weights": "weights",
    "sources": "the study's files",
}
"""The parts of a bundle, and what they are to a reader."""


@dataclass(frozen=True, slots=True)
class Part:
    """How far one part of a bundle was reproduced.

    Attributes:
        name: A key of `PARTS`.
        num_files: How many files it has in the bundle.
        num_reproduced: How many of them came out the same, byte by byte.
        differences: The files that did not, that are missing, or that are there and should not be.
        is_compared: False for weights that were taken from the bundle, which proves nothing about them.
    """

    name: str
    num_files: int
    num_reproduced: int
    differences: tuple[str, ...]
    is_compared: bool = True


@dataclass(frozen=True, slots=True)
class Verified:
    """What came of building a bundle again.

    Attributes:
        version: The name of the bundle, which rows of the data carry.
        is_whole: Whether the bundle's files still hash to its name.
        weights: Where the weights came from; None if its agents have none.
        parts: One for each part.
        notes: What differs about how it was built, such as the versions of packages.
    """

    version: str
    is_whole: bool
    weights: Weights | None
    parts: tuple[Part, ...]
    notes: tuple[str, ...]

    @property
    def is_proven(self) -> bool:
        """Whether the bundle is whole, and all that participants saw came out again."""
        shown = [part for part in self.parts if part.name != "weights"]
        return self.is_whole and bool(shown) and not any(part.differences for part in shown)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {**asdict(self), "is_proven": self.is_proven}


def verify(folder: Path, weights: Weights, progress: ReportProgress) -> Verified:
    """Build a bundle again from its own sources and compare the two; nothing of it is changed.

    Args:
        folder: The bundle's folder, named after its version.
        weights: Whether its agents are taken from it or trained again.
        progress: Is told what is being done.

    Raises:
        BundleError: The folder holds no bundle, or none with sources.
    """
    manifest = _manifest(folder)
    uses_stored = manifest["agents"] == "learned" and weights == "stored"
    agents = _provider(manifest["agents"], folder / WEIGHTS, uses_stored=uses_stored)
    parts: tuple[Part, ...] = ()
    with tempfile.TemporaryDirectory(prefix="xar-verify-") as scratch:
        try:
            rebuilt = _rebuild(folder, Path(scratch), progress, agents)
        except (BuildError, BundleError, StudyError) as error:
            notes = [f"it cannot be built again: {error}"]
        else:
            parts = tuple(
                _compare(name, folder, rebuilt, is_compared=name != "weights" or not uses_stored) for name in PARTS
            )
            notes = _notes(folder, manifest, _manifest(rebuilt))
    used = weights if manifest["agents"] == "learned" else None
    return Verified(folder.name, bundle_version(folder) == folder.name, used, parts, tuple(notes))


def _rebuild(folder: Path, scratch: Path, progress: ReportProgress, agents: AgentProvider) -> Path:
    sources = folder / SOURCES
    study = shutil.copytree(sources / STUDY, scratch / "study" / _study_name(folder), copy_function=shutil.copyfile)
    built = build(Path(study), scratch / "instance", progress, agents, sources / SHARED)
    return scratch / "instance" / "bundles" / built.catalogue.version


def stored_agents(weights: Path) -> AgentProvider:
    """Return a way to the agents of a bundle that reads their weights instead of training them."""

    def provide(sources: Sources, progress: ReportProgress) -> Agents:
        from webapp.explainer import learning  # noqa: PLC0415 - torch is loaded only where something was trained.

        progress("reading weights", 0.0)
        try:
            agents = learning.load(weights, list(sources.layouts.values()))
        except (OSError, ValueError, TypeError) as error:
            raise BundleError(f"the weights {weights} cannot be used: {error}") from None
        progress("reading weights", 1.0)
        by_layout = dict(zip(sources.layouts, agents, strict=True))
        return Agents(
            kind="learned",
            by_layout={name: Agent(agent.policy, agent.tabulate(), agent.facts) for name, agent in by_layout.items()},
            settings={},
            seconds={},
            save=lambda folder: learning.save(agents, folder / WEIGHTS),
        )

    provide.__name__ = "stored_agents"
    return provide


def _provider(kind: str, weights: Path, *, uses_stored: bool) -> AgentProvider:
    if kind == "planner":
        return planner_agents
    return stored_agents(weights) if uses_stored else learned_agents


def _manifest(folder: Path) -> Mapping[str, Any]:
    try:
        manifest: Mapping[str, Any] = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BundleError(f"{folder} is no study bundle ({error})") from None
    if not (folder / SOURCES / STUDY).is_dir():
        raise BundleError(f"{folder} holds no sources, so it cannot be built again from itself; run `xar build`")
    return manifest


def _study_name(folder: Path) -> str:
    """Return the name of the study whose sources these are, read as text so that a damaged file is told as such."""
    text = (folder / SOURCES / STUDY / "study.toml").read_text(encoding="utf-8", errors="replace")
    found = re.search(r'^name\s*=\s*"([a-z0-9_-]+)"', text, re.MULTILINE)
    return found[1] if found else "study"


def _compare(name: str, stored: Path, rebuilt: Path, *, is_compared: bool) -> Part:
    before, after = _digests(stored, name), _digests(rebuilt, name)
    differences = [file for file in sorted(before.keys() | after.keys()) if before.get(file) != after.get(file)]
    if name == "pictures":  # A picture is named after its bytes; the catalogue knows it by that name.
        differences = sorted({*differences, *(file for file, digest in before.items() if Path(file).stem != digest)})
    same = [file for file in before if file not in differences]
    return Part(name, len(before), len(same), tuple(differences), is_compared)


def _digests(folder: Path, part: str) -> dict[str, str]:
    """Return the SHA-256 of each file of a part, by its path within the bundle."""
    belongs: Callable[[str], bool] = lambda name: name.startswith((f"{part}/", f"{part}."))
    names = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in names.items() if belongs(name)}


def _notes(folder: Path, before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    notes = []
    if program_of(folder) != running_program():
        theirs, ours = program_of(folder), running_program()
        notes.append(
            f"it was built by program {theirs.version} ({theirs.digest[:12]}), "
            f"and again by {ours.version} ({ours.digest[:12]})"
        )
    then, now = before["made_with"], after["made_with"]
    notes += [
        f"{what}: {then[what]} then, {now[what]} now" for what in ("python", "processor") if then[what] != now[what]
    ]
    packages = sorted(then["packages"].keys() | now["packages"].keys())
    for package in packages:
        was, is_now = then["packages"].get(package), now["packages"].get(package)
        if was != is_now:
            notes.append(f"{package}: {was} then, {is_now} now")
    return notes
