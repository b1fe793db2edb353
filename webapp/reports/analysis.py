"""A data set analysed: read, chosen, and made into a report, with the other choices that its sensitivity is about."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from webapp.reports import flow
from webapp.reports.assembly import Assembled, assemble
from webapp.reports.origin import Origin, origin_of
from webapp.reports.reading import DataSet, read_dataset
from webapp.reports.sections import sensitivity
from webapp.reports.selection import Selection, Wishes, select
from webapp.reports.study_data import StudyData


@dataclass(frozen=True, slots=True)
class Analysis:
    """What is analysed, before anything is computed.

    Attributes:
        data_set: Everything that was read.
        selection: What of it is analysed.
        origin: Where it comes from.
    """

    data_set: DataSet
    selection: Selection
    origin: Origin

    @property
    def data(self) -> StudyData:
        """What is analysed."""
        return self.selection.data

    def report(self) -> Assembled:
        """Compute everything, and return the report."""
        who = flow.section(self.data, self.selection)
        others = sensitivity.section(self.data, self.variants())
        return assemble(self.data, self.origin, first=(who,), more=(others,))

    def variants(self) -> list[tuple[str, StudyData]]:
        """Return what could have been chosen otherwise, in words, with the data that it gives."""
        data = self.data
        return [
            (words, select(self.data_set, data.study, data.study_version, data.mode, wishes).data)
            for words, wishes in _other_wishes(self.selection)
        ]


def prepare(
    path: Path,
    study: str | None = None,
    version: str | None = None,
    mode: str | None = None,
    *,
    include_incomplete: bool = False,
    changed_data_ok: bool = False,
) -> Analysis:
    """Read a data set and choose what is analysed.

    Args:
        path: A folder that `xar export` wrote, or whatever else `read_dataset` takes.
        study: The study's name; may be left out where there is only one.
        version: The version, or how its hash begins; likewise.
        mode: `live`, `test` or `bot`; live ones if left out.
        include_incomplete: Whether those are analysed too who did not complete the study.
        changed_data_ok: Whether files are read that are not those of the manifest.

    Raises:
        DataSetError: It cannot be read, or there are no such data.
    """
    data_set = read_dataset(path, changed_ok=changed_data_ok)
    selection = select(data_set, study, version, mode, Wishes(include_incomplete=include_incomplete))
    data = selection.data
    asked = {
        "study": data.study,
        "version": data.study_version,
        "mode": data.mode,
        "include_incomplete": include_incomplete,
        "changed_data_ok": changed_data_ok,
    }
    return Analysis(data_set, selection, origin_of(data_set.digests, asked, selection.notes, selection.differences))


def _other_wishes(selection: Selection) -> Iterator[tuple[str, Wishes]]:
    wishes = selection.wishes
    yield "nobody excluded", replace(wishes, apply_rules=False, apply_exclusions=False)
    if len(selection.rules) > 1:
        for rule in selection.rules:
            yield f"without the rule {rule}", replace(wishes, skip_rules=frozenset({rule}))
    yield "without researchers' exclusions", replace(wishes, apply_exclusions=False)
    yield "without corrections", replace(wishes, apply_corrections=False)
    words = "those who completed alone" if wishes.include_incomplete else "with those who did not complete"
    yield words, replace(wishes, include_incomplete=not wishes.include_incomplete)
