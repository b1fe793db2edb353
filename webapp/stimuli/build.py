"""Build a study bundle offline: train, explain, draw, and write everything under the hash of its content.

A bundle never changes once it is written; a new build with other content makes another one beside it. Only the
pointer to the current bundle moves.
"""

import json
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from webapp.stimuli.agents import AgentProvider, Agents, ReportProgress
from webapp.stimuli.catalogue import BundleError, Catalogue, bundle_version
from webapp.stimuli.learned import learned_agents
from webapp.stimuli.pictures import Album, draw_album
from webapp.stimuli.report import LayoutReport, inputs_digest, made_with, report_on
from webapp.stimuli.scenes import Scene, Walk, stage, walk
from webapp.stimuli.sources import Sources, read_sources
from webapp.stimuli.tables import canonical_json, catalogue_content, table_content


@dataclass(frozen=True, slots=True)
class Built:
    """A bundle, and how it came about.

    Attributes:
        catalogue: The bundle, open.
        reports: One for each layout.
        seconds: By layout, how long it took until its agent was trained; empty when nothing was trained.
        is_new: False if the same inputs had been built before, so that nothing was to be done.
    """

    catalogue: Catalogue
    reports: tuple[LayoutReport, ...]
    seconds: Mapping[str, float]
    is_new: bool


@dataclass(frozen=True, slots=True)
class _Explained:
    """All that there is to write down, by layout; scenes by experiment and layout."""

    agents: Agents
    walks: Mapping[str, Walk]
    scenes: Mapping[str, Mapping[str, Scene]]
    album: Album
    reports: tuple[LayoutReport, ...]


def build(
    study_folder: Path, instance: Path, progress: ReportProgress, agents: AgentProvider = learned_agents
) -> Built:
    """Build the bundle of a study, or find it if nothing has changed since it was built.

    Args:
        study_folder: The study's folder with `study.toml`, `layouts/` and `texts/`.
        instance: Where `bundles/` is; made if it is missing, closed to other accounts.
        progress: Is told what is being done.
        agents: Where the agents come from. What people are shown is made by `learned_agents`; `planner_agents` takes
            seconds instead of minutes and is for tests.

    Raises:
        StudyError: The study's files cannot be used; the message has a line for each problem.
        BuildError: An agent or a world model was not right in the end, or what an agent does cannot be shown as the
            study wants it.
    """
    sources = read_sources(study_folder)
    instance.mkdir(mode=0o700, parents=True, exist_ok=True)
    bundles = instance / "bundles"
    record = bundles / "records" / f"{inputs_digest(study_folder, agents.__name__)}.json"
    record.parent.mkdir(parents=True, exist_ok=True)
    built = _built_before(bundles, record)
    if built is None:
        explained = _explain(sources, agents, progress)
        version = _write_bundle(bundles, sources, explained)
        seconds = dict(explained.agents.seconds)
        _write_whole(record, canonical_json({"version": version, "seconds": seconds}))
        built = Built(Catalogue.open(bundles / version), explained.reports, seconds, is_new=True)
    _write_whole(bundles / f"current-{sources.study.name}", f"{built.catalogue.version}\n".encode())
    return built


def _built_before(bundles: Path, record: Path) -> Built | None:
    try:
        known = json.loads(record.read_text(encoding="utf-8"))
        folder = bundles / known["version"]
        catalogue = Catalogue.open(folder)
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError, BundleError):
        return None
    reports = tuple(LayoutReport(**report) for report in manifest["report"])
    return Built(catalogue, reports, known["seconds"], is_new=False)


def _explain(sources: Sources, provider: AgentProvider, progress: ReportProgress) -> _Explained:
    study, settings = sources.study, sources.study.explanation
    agents = provider(sources, progress)
    progress("explaining", 0.0)
    walks = {name: walk(name, agents.by_layout[name], settings) for name in study.layouts}
    scenes = {
        experiment.id: {
            name: stage(study, experiment, name, sources.layouts[name], agents.by_layout[name], walks[name])
            for name in experiment.layouts
        }
        for experiment in study.experiments
    }
    reports = tuple(
        report_on(
            study,
            name,
            sources.layouts[name],
            agents.by_layout[name],
            walks[name],
            {experiment: by_layout[name] for experiment, by_layout in scenes.items() if name in by_layout},
        )
        for name in study.layouts
    )
    progress("explaining", 1.0)
    worlds = {name: agent.world for name, agent in agents.by_layout.items()}
    album = draw_album(sources, worlds, lambda done: progress("drawing pictures", done))
    return _Explained(agents, walks, scenes, album, reports)


def _write_bundle(bundles: Path, sources: Sources, explained: _Explained) -> str:
    """Write a bundle under another name and give it its own when it is whole.

    Returns:
        The version.
    """
    draft = Path(tempfile.mkdtemp(prefix="draft-", dir=bundles))
    try:
        _write_files(draft, sources, explained)
        version = bundle_version(draft)
        target = bundles / version
        if target.exists() and not _is_whole(target):
            shutil.rmtree(target)
        if not target.exists():
            draft.rename(target)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return version


def _write_files(folder: Path, sources: Sources, explained: _Explained) -> None:
    content = catalogue_content(sources, explained.scenes, explained.album)
    (folder / "catalogue.json").write_bytes(canonical_json(content))
    (folder / "manifest.json").write_bytes(canonical_json(_manifest(sources, explained)))
    for part in ("tables", "pictures"):
        (folder / part).mkdir()
    for name in sources.layouts:
        table = table_content(
            sources, name, explained.agents.by_layout[name], explained.walks[name], explained.album.numbers[name]
        )
        (folder / "tables" / f"{name}.json").write_bytes(canonical_json(table))
    for digest, picture in explained.album.files.items():
        (folder / "pictures" / f"{digest}.png").write_bytes(picture)
    explained.agents.save(folder)


def _manifest(sources: Sources, explained: _Explained) -> dict[str, Any]:
    study = sources.study
    return {
        "study": study.name,
        "agents": explained.agents.kind,
        "training_settings": explained.agents.settings,
        "training_seeds": {name: study.training_seed(name) for name in study.layouts},
        "made_with": made_with(),
        "report": [report.to_json() for report in explained.reports],
    }


def _is_whole(folder: Path) -> bool:
    return bundle_version(folder) == folder.name


def _write_whole(file: Path, content: bytes) -> None:
    """Write a file so that it is never seen half written."""
    with tempfile.NamedTemporaryFile(dir=file.parent, prefix=f"{file.name}.", delete=False) as draft:
        draft.write(content)
    Path(draft.name).replace(file)
