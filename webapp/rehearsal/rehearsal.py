"""A whole rehearsal: a stage, bots on it, their data set, its report, and whether that tells the truth."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from webapp.analysis.planned_comparisons import compare_kinds
from webapp.rehearsal.beside_ratings import Shown, beside
from webapp.rehearsal.performance import Cast, perform
from webapp.rehearsal.planting import told
from webapp.rehearsal.stage import a_stage
from webapp.rehearsal.tables import beside_table, verdict_table
from webapp.rehearsal.verdicts import Verdict, judge
from webapp.reports.analysis import Analysis
from webapp.reports.blocks import Table
from webapp.reports.csv_tables import csv_of
from webapp.reports.origin import origin_of
from webapp.reports.reading import read_dataset
from webapp.reports.selection import select
from webapp.reports.study_data import StudyData
from webapp.reports.writing import files_of_report
from webapp.stimuli.agents import AgentProvider, ReportProgress


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """What came of a rehearsal.

    Attributes:
        verdicts: One for each planned test.
        beside: What was planted beside them.
        report: The files of the report, by name.
        data: The files of the data set, by name.
    """

    verdicts: tuple[Verdict, ...]
    beside: tuple[Shown, ...]
    report: Mapping[str, bytes]
    data: Mapping[str, bytes]

    @property
    def is_well(self) -> bool:
        """Whether every planned test came out as planted."""
        return all(verdict.is_good for verdict in self.verdicts)

    def files(self) -> dict[str, bytes]:
        """Return everything that is worth keeping, by name."""
        tables = {f"{table.name}.csv": csv_of(table) for table in self._tables()}
        report = {f"report/{name}": content for name, content in self.report.items()}
        return {**tables, **report, **{f"data/{name}": content for name, content in self.data.items()}}

    def _tables(self) -> tuple[Table, ...]:
        return (verdict_table(self.verdicts), *([beside_table(self.beside)] if self.beside else []))


def rehearse(
    folder: Path,
    instance: Path,
    cast: Cast,
    now: datetime,
    *,
    building: ReportProgress,
    on_end: Callable[[], None],
    agents: AgentProvider,
) -> Rehearsed:
    """Let bots take part in a study, and compare what its report finds with what was planted in them.

    Args:
        folder: The study's.
        instance: The user's; its bundle is used if it is up to date, and nothing is written there.
        cast: Who takes part, with the planted effects.
        now: The time of the export.
        building: Is told how building goes on, if the study has to be built.
        on_end: Told of each bot that is done.
        agents: Where agents come from.

    Raises:
        BotError: Bots got stuck, or not everything was stored once.
        DataSetError: The data cannot be analysed.
        BuildError: The study cannot be built.
        StudyError: Its files cannot be used.
    """
    with tempfile.TemporaryDirectory(prefix="xar-rehearsal-data-") as scratch:
        data_set = Path(scratch) / "data"
        with a_stage(folder, instance, building, agents) as (config, catalogue):
            perform(config, catalogue, cast, data_set, now, on_end)
        data, report = _analysed(data_set, cast)
        files = {path.relative_to(data_set).as_posix(): path.read_bytes() for path in _files_in(data_set)}
    verdicts = judge(compare_kinds(data.ratings, data.plan), cast.effects)
    return Rehearsed(verdicts, beside(data, cast.effects), report, files)


def _analysed(folder: Path, cast: Cast) -> tuple[StudyData, Mapping[str, bytes]]:
    """Return the data that are analysed and the files of the report, as `xar analyse --mode bot` makes it."""
    read = read_dataset(folder)
    chosen = select(read, mode="bot")
    asked = {
        "study": chosen.data.study,
        "version": chosen.data.study_version,
        "mode": "bot",
        "planted": list(told(cast.effects)),
    }
    analysis = Analysis(read, chosen, origin_of(read.digests, asked, chosen.notes, chosen.differences))
    return analysis.data, files_of_report(analysis.report(), analysis.data, analysis.origin)


def _files_in(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())
