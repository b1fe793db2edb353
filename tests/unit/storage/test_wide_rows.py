from pathlib import Path

from tests.unit.storage.exported import LATER, STUDY, files_of, rows_of, wanted_of
from tests.unit.storage.people import enrol_somebody
from tests.unit.storage.rows import write_rows
from webapp.storage.database import Database
from webapp.storage.dataset import data_name, export
from webapp.storage.wanted import AS_STORED, Wanted, bundles_in


def test_a_row_of_the_wide_file_holds_what_the_long_ones_do(database: Database, tmp_path: Path) -> None:
    write_rows(database)
    export(database, tmp_path / "out", AS_STORED, LATER)
    files = files_of(tmp_path / "out")
    people = {row["participant"]: row for row in rows_of(files[data_name("wide.csv")])}
    assert len(people) == 4
    for rating in rows_of(files[data_name("ratings.csv")]):
        person, trial = people[rating["participant"]], f"{rating['experiment']}.{rating['trial']}"
        assert person[f"{trial}.rating.{rating['item']}"] == rating["rating"]
        assert person[f"{trial}.response_time_ms.{rating['item']}"] == rating["response_time_ms"]
        assert [person[f"{trial}.{name}"] for name in ("kind", "layout", "draw")] == [
            rating[name] for name in ("kind", "layout", "draw")
        ]
        assert person[f"{trial}.submitted_at"] == rating["submitted_at"]
    for drive in rows_of(files[data_name("drives.csv")]):
        if drive["trial"]:
            person = people[drive["participant"]]
            assert person[f"{drive['experiment']}.{drive['trial']}.{drive['phase']}.end"] == drive["end"]
    done = people["2345678abc"]
    assert [done[f"1.1.predictions.{name}"] for name in ("num", "num_correct", "share_correct")] == ["2", "1", "0.5"]
    assert done["background.words"] == "ロボット"
    assert {people["zzzzzzzzzz"][f"1.1.{name}"] for name in ("rating.ease", "submitted_at", "after.end")} == {""}


def test_a_version_has_the_same_wide_columns_whatever_is_stored(live: Database, tmp_path: Path) -> None:
    export(live, tmp_path / "many", wanted_of(live), LATER)
    with live.read() as connection:
        (version,) = {row[0] for row in connection.exec_driver_sql("SELECT study_version FROM participants")}
    enrol_somebody(live, "test", version, study=STUDY)
    wanted = Wanted(mode="test", find_bundle=bundles_in(live.path.parent))
    assert export(live, tmp_path / "one", wanted, LATER)[data_name("wide.csv")] == 1
    first, second = (
        (tmp_path / name / data_name("wide.csv")).read_bytes().partition(b"\r\n")[0] for name in ("many", "one")
    )
    assert first == second


def test_everything_of_a_trial_has_a_column_in_the_wide_table(files: dict[str, bytes]) -> None:
    people = {row["participant"]: row for row in rows_of(files[data_name("wide.csv")])}
    ratings, drives, probes = (rows_of(files[data_name(f"{name}.csv")]) for name in ("ratings", "drives", "probes"))
    assert ratings
    assert {drive["phase"] for drive in drives} == {"practice", "before", "after"}
    for row in ratings:
        wide, trial = people[row["participant"]], f"{row['experiment']}.{row['trial']}"
        assert wide[f"{trial}.rating.{row['item']}"] == row["rating"]
    for row in (row for row in drives if row["phase"] != "practice"):
        wide, drive = people[row["participant"]], f"{row['experiment']}.{row['trial']}.{row['phase']}"
        assert [wide[f"{drive}.{name}"] for name in ("end", "num_steps")] == [row["end"], row["num_steps"]]
    counted = sum(int(wide[f"1.{trial}.predictions.num"] or 0) for wide in people.values() for trial in (1, 2, 3))
    assert counted == len(probes) > 0
