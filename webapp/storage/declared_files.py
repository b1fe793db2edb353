"""The study files in a data set: what was declared before there were data, exactly as it was frozen.

Whoever analyses the data needs them: the rules, the planned comparisons, the points of each scale.
"""

from collections.abc import Iterator

from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.frozen_files import SOURCES, STUDY
from webapp.storage.dataset_description import Covered
from webapp.storage.wanted import Wanted

STUDIES = "studies"
"""The folder within a data set."""

_SHOWN = 12
"""How much of a version's hash is in the name of its folder."""


def study_folder(study: str, version: str) -> str:
    """Return the folder of a version's declared files within a data set, such as `studies/sakai2021-0123456789ab`."""
    return f"{STUDIES}/{study}-{version[:_SHOWN]}"


def declared_files(covered: Covered, wanted: Wanted) -> Iterator[tuple[str, bytes]]:
    """Yield the study file and the plan in words of each version whose bundle is there: name in the data set, content.

    Raises:
        OSError: A file of a bundle cannot be read.
    """
    for study, version in dict.fromkeys((scope.study, scope.study_version) for scope in covered.participants):
        bundle = wanted.find_bundle(version)
        if bundle is not None:
            yield from _of_bundle(bundle, study_folder(study, version))


def _of_bundle(bundle: Catalogue, folder: str) -> Iterator[tuple[str, bytes]]:
    frozen = bundle.folder / SOURCES / STUDY
    plan = None if bundle.study.analysis is None else bundle.study.analysis.plan
    for name in filter(None, ("study.toml", plan)):
        # Bundles from before sources were kept have none.
        if (frozen / name).is_file():
            yield f"{folder}/{name}", (frozen / name).read_bytes()
