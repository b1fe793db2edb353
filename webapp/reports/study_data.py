"""The data of one version of a study in one mode, as the sections of a report take them."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from webapp.study.analysis_plan import Plan
from webapp.study.protocol import Study


@dataclass(frozen=True, slots=True)
class StudyData:
    """All that is analysed. Rows of people who are not analysed are gone, corrections are made.

    Every table has a plain `RangeIndex` and is sorted by `participant`, then by experiment and trial. Text columns hold
    `str`, whole numbers `int64` (nullable ones `Int64`), shares `float64`, truth values `bool` (nullable: `boolean`),
    times `datetime64[us, UTC]`. Columns beyond those that the data dictionary names are dropped.

    Attributes:
        study: The study's name.
        study_version: The hash of its bundle, empty if the data do not say.
        mode: `live`, `test` or `bot`.
        ratings: One row per rating: `participant, experiment, trial, layout, kind, draw, item, rating,
            response_time_ms`. Never empty of columns; no participant, trial and item comes twice.
        participants: One row per person who is analysed: at least `participant`.
        everybody: One row per person of the version and mode, also those who are not analysed, with `participant`,
            `consented_at`, `completed_at`, `withdrawn_at`, `screened_out_at`, `num_pages_sent`, `assignment` and
            `reason` (why not analysed: a rule's name, `excluded by a researcher`, `incomplete`, `left before the
            first rating` or `answered nothing`; None if analysed).
            None if there is no `participants.csv`.
        answers: Of `answers.csv`, None without the file; likewise the next two.
        probes: Of `probes.csv`.
        drives: Of `drives.csv`.
        declared: The study file, None if it is not in the data set.
        wordings: The wording of each item by its id, as far as the data set says.
        points: How many points each item's scale has, by experiment and item: declared, described by
            the data set, or else the largest rating, at least 5.
        plan: What was planned, or the default plan.
    """

    study: str
    study_version: str
    mode: str
    ratings: pd.DataFrame
    participants: pd.DataFrame
    everybody: pd.DataFrame | None
    answers: pd.DataFrame | None
    probes: pd.DataFrame | None
    drives: pd.DataFrame | None
    declared: Study | None
    wordings: Mapping[str, str]
    points: Mapping[tuple[str, str], int]
    plan: Plan
