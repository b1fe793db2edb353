"""Where a rehearsal is held: an instance of its own that is gone afterwards, with the study's bundle in it."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from webapp.config import Config
from webapp.stimuli.agents import AgentProvider, ReportProgress
from webapp.stimuli.build import build, find_built
from webapp.stimuli.catalogue import Catalogue
from webapp.storage.instance import prepare_instance


@contextmanager
def a_stage(
    folder: Path, instance: Path, progress: ReportProgress, agents: AgentProvider
) -> Iterator[tuple[Config, Catalogue]]:
    """Make a temporary instance in which a study can be served.

    The bundle is copied from the user's instance if it was built there from the files as they are now, and else built.
    Nothing is written to the user's instance.

    Args:
        folder: The study's.
        instance: The user's.
        progress: Is told how building goes on.
        agents: Where the agents come from, if it has to be built.

    Raises:
        StudyError: The study's files cannot be used.
        BuildError: It cannot be built.
    """
    built = find_built(folder, instance, agents)
    with tempfile.TemporaryDirectory(prefix="xar-rehearsal-") as scratch:
        stage = Path(scratch) / "instance"
        prepare_instance(stage)
        if built is None:
            catalogue = build(folder, stage, progress, agents).catalogue
        else:
            bundles = stage / "bundles"
            shutil.copytree(built, bundles / built.name)
            catalogue = Catalogue.open(bundles / built.name)
            (bundles / f"current-{catalogue.study.name}").write_text(f"{catalogue.version}\n", encoding="ascii")
        yield Config(stage, study=catalogue.study.name), catalogue
