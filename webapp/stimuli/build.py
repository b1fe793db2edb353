"""Build a study bundle offline: train, explain, draw, and write everything under the hash of its content.

A bundle never changes once it is written; a new build with other content makes another one beside it. Only the
pointer to the current bundle moves.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from webapp.stimuli.agents import AgentProvider, Agents, ReportProgress, agents_of
from webapp.stimuli.catalogue import BundleError, Catalogue, bundle_version
from webapp.stimuli.frozen_files import SOURCES, check_apart, frozen_files
from webapp.stimuli.learned import learned_agents
from webapp.stimuli.pictures import Album, draw_album
from webapp.stimuli.plug_ins import PLUG_INS, study_modules
from webapp.stimuli.program import running_program
from webapp.stimuli.publication import MANIFEST, unlock
from webapp.stimuli.report import LayoutReport, inputs_digest, made_with, report_on
from webapp.stimuli.scenes import Scene, Walk, stage, walk
from webapp.stimuli.sources import SHARED_TEXTS, Sources, read_sources
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
    """All that there is to write down, by layout; scenes by experiment and layout; files as `frozen_files`."""

    files: Mapping[str, bytes]
    agents: Agents
    walks: Mapping[str, Walk]
    scenes: Mapping[str, Mapping[str, Scene]]
    album: Album
    reports: tuple[LayoutReport, ...]


def build(
    study_folder: Path,
    instance: Path,
    progress: ReportProgress,
    agents: AgentProvider = learned_agents,
    shared_texts: Path = SHARED_TEXTS,
) -> Built:
    """Build the bundle of a study, or find it if nothing has changed since it was built.

    Args:
        study_folder: The study's folder with `study.toml`, `layouts/` and `texts/`.
        instance: Where `bundles/` is; made if it is missing, closed to other accounts.
        progress: Is told what is being done.
        agents: Where the agents come from. What people are shown is made by `learned_agents`; `planner_agents` takes
            seconds instead of minutes and is for tests.
        shared_texts: The texts that all studies share.

    Raises:
        StudyError: The study's files cannot be used; the message has a line for each problem.
        BuildError: An agent or a world model was not right in the end, or what an agent does cannot be shown as the
            study wants it.
    """
    with study_modules(study_folder):
        return _build(study_folder, instance, progress, agents, shared_texts)


def _build(
    study_folder: Path, instance: Path, progress: ReportProgress, agents: AgentProvider, shared_texts: Path
) -> Built:
    check_apart(study_folder, instance)
    sources = read_sources(study_folder, shared_texts)
    files = _files(study_folder, sources, shared_texts)
    instance.mkdir(mode=0o700, parents=True, exist_ok=True)
    bundles = instance / "bundles"
    record = _record(bundles, agents, files)
    record.parent.mkdir(parents=True, exist_ok=True)
    built = _built_before(bundles, record)
    if built is None:
        explained = _explain(sources, files, agents, progress)
        version = _write_bundle(bundles, lambda draft: _write_files(draft, sources, explained))
        seconds = dict(explained.agents.seconds)
        _write_whole(record, canonical_json({"version": version, "seconds": seconds}))
        built = Built(Catalogue.open(bundles / version), explained.reports, seconds, is_new=True)
    _write_whole(bundles / f"current-{sources.study.name}", f"{built.catalogue.version}\n".encode())
    return built


def find_built(study_folder: Path, instance: Path, agents: AgentProvider = learned_agents) -> Path | None:
    """Return the folder of a study's bundle if it was built and nothing has changed since; writes nothing.

    Raises:
        StudyError: The study's files cannot be used.
    """
    check_apart(study_folder, instance)
    files = _files(study_folder, read_sources(study_folder), SHARED_TEXTS)
    bundles = instance / "bundles"
    try:
        known = json.loads(_record(bundles, agents, files).read_text(encoding="utf-8"))
        folder = bundles / str(known["version"])
        Catalogue.open(folder)
    except (OSError, json.JSONDecodeError, BundleError):
        return None
    return folder


def _files(study_folder: Path, sources: Sources, shared_texts: Path) -> Mapping[str, bytes]:
    """Return the files that a study is built from, and where its own kinds and worlds come from, if it has some."""
    files = frozen_files(study_folder, sources.study, shared_texts)
    if not sources.origins:
        return files
    origins = {name: origin.to_json() for name, origin in sources.origins.items()}
    return {**files, PLUG_INS: canonical_json(origins)}


def _record(bundles: Path, agents: AgentProvider, files: Mapping[str, bytes]) -> Path:
    """Return the file that says which bundle was built from these files."""
    return bundles / "records" / f"{inputs_digest(agents.__name__, files)}.json"


def _built_before(bundles: Path, record: Path) -> Built | None:
    try:
        known = json.loads(record.read_text(encoding="utf-8"))
        folder = bundles / known["version"]
        catalogue = Catalogue.open(folder)
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError, BundleError):
        return None
    reports = tuple(LayoutReport(**report) for report in manifest["report"])
    if manifest["program"] != running_program().to_json():
        version = _write_bundle(bundles, lambda draft: _copy_for_this_program(folder, manifest, draft))
        _write_whole(record, canonical_json({**known, "version": version}))
        catalogue = Catalogue.open(bundles / version)
    return Built(catalogue, reports, known["seconds"], is_new=False)


def _copy_for_this_program(folder: Path, manifest: Mapping[str, Any], draft: Path) -> None:
    """Copy a bundle that would come out the same, and say of the copy that it belongs to the program as it is now.

    That program shows the same otherwise, so the version is another; nothing has to be trained for it.
    """
    for file in folder.rglob("*"):
        if file.is_file():
            target = draft / file.relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(file.read_bytes())
    (draft / MANIFEST).write_bytes(canonical_json({**manifest, "program": running_program().to_json()}))


def _explain(
    sources: Sources, files: Mapping[str, bytes], provider: AgentProvider, progress: ReportProgress
) -> _Explained:
    study, settings = sources.study, sources.study.explanation
    agents = agents_of(sources, provider, progress)
    progress("explaining", 0.0)
    walks = {name: walk(name, agents.by_layout[name], settings) for name in study.layouts}
    scenes = {
        experiment.id: {
            name: stage(
                study,
                experiment,
                name,
                sources.layouts.get(name),
                agents.by_layout[name],
                walks[name],
                sources.kinds,
            )
            for name in experiment.layouts
        }
        for experiment in study.experiments
    }
    reports = tuple(
        report_on(
            study,
            name,
            sources.exact_table(name),
            agents.by_layout[name],
            walks[name],
            {experiment: by_layout[name] for experiment, by_layout in scenes.items() if name in by_layout},
        )
        for name in study.layouts
    )
    progress("explaining", 1.0)
    worlds = {name: agent.world for name, agent in agents.by_layout.items()}
    album = draw_album(sources, worlds, lambda done: progress("drawing pictures", done))
    return _Explained(files, agents, walks, scenes, album, reports)


def _write_bundle(bundles: Path, write: Callable[[Path], None]) -> str:
    """Write a bundle under another name and give it its own when it is whole.

    Args:
        bundles: Where all bundles are.
        write: Writes the files into an empty folder.

    Returns:
        The version.
    """
    draft = Path(tempfile.mkdtemp(prefix="draft-", dir=bundles))
    try:
        write(draft)
        version = bundle_version(draft)
        target = bundles / version
        if target.exists() and not _is_whole(target):
            unlock(target)
            shutil.rmtree(target)
        if not target.exists():
            draft.rename(target)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return version


def _write_files(folder: Path, sources: Sources, explained: _Explained) -> None:
    content = catalogue_content(sources, explained.scenes, explained.album)
    (folder / "catalogue.json").write_bytes(canonical_json(content))
    (folder / MANIFEST).write_bytes(canonical_json(_manifest(sources, explained)))
    for name, source in explained.files.items():
        file = folder / SOURCES / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(source)
    for part in ("tables", "pictures"):
        (folder / part).mkdir()
    for name in sources.study.layouts:
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
        "program": running_program().to_json(),
        "report": [report.to_json() for report in explained.reports],
    }


def _is_whole(folder: Path) -> bool:
    return bundle_version(folder) == folder.name


def _write_whole(file: Path, content: bytes) -> None:
    """Write a file so that it is never seen half written."""
    with tempfile.NamedTemporaryFile(dir=file.parent, prefix=f"{file.name}.", delete=False) as draft:
        draft.write(content)
    Path(draft.name).replace(file)
