"""Who and what is analysed: chosen by name, by rules before kinds are looked at, and corrected."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.reports.data_sets import (
    PEOPLE,
    STUDY_FILE,
    VERSION,
    Row,
    Tables,
    decision,
    flag,
    tables,
    write_exported,
    write_plain,
)
from webapp.reports.people import headcount
from webapp.reports.read_exclusions import BEFORE_RATING, BY_RESEARCHER, INCOMPLETE, WITHOUT_ANSWERS, decide
from webapp.reports.reading import DataSet, DataSetError, read_dataset
from webapp.reports.selection import Selection, Wishes, choose, select
from webapp.study.analysis_plan import Contrast

RATED = "2031-03-01T12:00:00.000000Z"
"""After everybody has finished."""
RULES = b"[quality]\nstraight_lining = true\nincomplete = true\nmin_total_minutes = 3.0\n\n[consent]"


@pytest.fixture
def data() -> Tables:
    return tables()


def read(data: Tables, folder: Path, study_file: bytes | None = None) -> DataSet:
    return read_dataset(write_exported(folder, data, study_file))


def selected(data: Tables, folder: Path, study_file: bytes | None = None, **wishes: object) -> Selection:
    return select(read(data, folder, study_file), wishes=Wishes(**wishes))  # type: ignore[arg-type]


def reasons_of(selection: Selection) -> dict[str, str]:
    everybody = selection.data.everybody
    assert everybody is not None
    told = everybody.dropna(subset="reason")
    return dict(zip(told["participant"], told["reason"], strict=True))


def ratings_of(selection: Selection, person: str, experiment: str = "1", trial: int = 1) -> dict[str, int]:
    ratings = selection.data.ratings
    own = ratings[
        (ratings["participant"] == person) & (ratings["experiment"] == experiment) & (ratings["trial"] == trial)
    ]
    return dict(zip(own["item"], own["rating"].astype(int), strict=True))


def test_a_whole_data_set_is_analysed_whole(data: Tables, tmp_path: Path) -> None:
    found = selected(data, tmp_path, STUDY_FILE.read_bytes())
    chosen = found.data
    assert (chosen.study, chosen.study_version, chosen.mode) == ("sakai2021", VERSION, "live")
    assert list(chosen.ratings.columns) == [
        *("participant", "experiment", "trial", "layout", "kind", "draw", "item", "rating", "response_time_ms")
    ]
    assert len(chosen.ratings) == 6 * 15
    assert list(chosen.participants["participant"]) == list(PEOPLE)
    assert reasons_of(found) == {}
    assert chosen.plan.is_declared
    assert chosen.points["2", "general"] == 5
    assert isinstance(chosen.ratings.index, pd.RangeIndex)
    assert (chosen.answers, chosen.probes, chosen.drives) == (None, None, None)


def test_without_a_study_file_the_plan_follows_from_the_data(data: Tables, tmp_path: Path) -> None:
    chosen = selected(data, tmp_path).data
    assert chosen.declared is None
    assert chosen.plan.contrasts == (
        Contrast("1", "subgoals", "full"),
        Contrast("1", "subgoals", "random"),
        Contrast("2", "all_key_points", "first_key_point"),
    )
    assert not chosen.plan.is_declared


def test_a_single_kind_has_a_plan_without_contrasts(data: Tables, tmp_path: Path) -> None:
    data["ratings"] = [row for row in data["ratings"] if row["kind"] == "full"]
    chosen = selected(data, tmp_path).data
    assert (chosen.plan.contrasts, chosen.plan.num_tests) == ((), 0)
    assert len(chosen.ratings) == 18


def test_whoever_did_not_complete_is_not_analysed_unless_asked_for(data: Tables, tmp_path: Path) -> None:
    data["participants"][0]["completed_at"] = ""
    data["participants"][1].update(completed_at="", withdrawn_at=RATED)
    data["participants"][2].update(completed_at="", screened_out_at=RATED)
    without = selected(data, tmp_path)
    assert reasons_of(without) == dict.fromkeys(PEOPLE[:3], INCOMPLETE)
    assert set(without.data.ratings["participant"]) == set(PEOPLE[3:])
    again = selected(data, tmp_path, include_incomplete=True)
    assert reasons_of(again) == {}
    assert "Those who did not complete the study are analysed too, with what they answered." in again.notes


def test_whoever_left_before_the_first_rating_is_not_analysed_with_the_incomplete(data: Tables, tmp_path: Path) -> None:
    data["participants"][0]["completed_at"] = ""
    data["participants"][1].update(completed_at="", withdrawn_at=RATED)
    data["quality"] = [flag("person1", "straight_lining")]
    data["ratings"] = [row for row in data["ratings"] if row["participant"] not in {"person1", "person2"}]
    found = selected(data, tmp_path, include_incomplete=True)
    assert reasons_of(found) == {"person1": BEFORE_RATING, "person2": WITHOUT_ANSWERS}
    assert list(found.data.participants["participant"]) == sorted(set(found.data.ratings["participant"]))
    assert headcount(found.data).analysed == 4
    without = selected(data, tmp_path / "again")
    assert reasons_of(without) == {"person0": INCOMPLETE, "person1": INCOMPLETE, "person2": WITHOUT_ANSWERS}


def test_whoever_completed_and_was_asked_for_predictions_alone_is_analysed(data: Tables, tmp_path: Path) -> None:
    row = next(row for row in data["ratings"] if row["participant"] == "person2")
    probe = {name: row[name] for name in ("study", "study_version", "mode", "participant", "experiment", "trial")}
    probe |= {"layout": row["layout"], "kind": row["kind"], "question": "1", "predicted": "left", "action": "forward"}
    data["probes"] = [probe | {"is_correct": "false", "is_as_good": "false", "confidence": "3"}]
    data["ratings"] = [row for row in data["ratings"] if row["participant"] != "person2"]
    assert reasons_of(selected(data, tmp_path)) == {}


def test_without_a_study_file_an_item_has_the_points_of_its_largest_rating(data: Tables, tmp_path: Path) -> None:
    for row in data["ratings"]:
        if row["item"] == "general":
            row["rating"] = str(int(row["rating"]) + 2)
    found = select(read_dataset(write_plain(tmp_path, {"ratings": data["ratings"]})))
    points = {item: found.data.points["2", item] for item in ("general", "likeliness", "loveliness")}
    assert points == {"general": 7, "likeliness": 5, "loveliness": 5}
    assert (
        "There is no study file, so scales have the points of the largest rating, at least 5: "
        "5 points for likeliness, loveliness; 7 points for general."
    ) in found.notes


def test_points_that_are_declared_or_described_are_not_taken_from_ratings(data: Tables, tmp_path: Path) -> None:
    for name, study in (("declared", STUDY_FILE.read_bytes()), ("described", None)):
        found = selected(data, tmp_path / name, study)
        assert not any("largest rating" in note for note in found.notes)
        assert found.data.points["1", "general"] == 5


def test_rules_and_researchers_leave_out_and_each_can_be_switched_off(data: Tables, tmp_path: Path) -> None:
    data["quality"] = [
        flag("person0", "straight_lining"),
        flag("person0", "min_total_minutes"),
        flag("person1", "straight_lining"),
        flag("person2", "straight_lining", flagged=False),
    ]
    data["participants"][1]["excluded_at"] = data["participants"][2]["excluded_at"] = "2031-03-01T09:45:00.000000Z"
    study = STUDY_FILE.read_bytes().replace(b"[consent]", RULES, 1)
    found = selected(data, tmp_path, study)
    assert found.rules == ("min_total_minutes", "straight_lining")
    assert found.decided.flagged == {"min_total_minutes": 1, "straight_lining": 2}
    assert reasons_of(found) == {
        "person0": "min_total_minutes",
        "person1": "straight_lining",
        "person2": BY_RESEARCHER,
    }
    assert any(note.startswith("Declared exclusion rules that cannot be applied: incomplete.") for note in found.notes)
    data_set = read(data, tmp_path, study)
    assert set(choose(data_set, apply_rules=False).participants["participant"]) == set(PEOPLE) - {"person1", "person2"}
    assert set(choose(data_set, apply_exclusions=False).participants["participant"]) == set(PEOPLE[2:])
    without_times = choose(data_set, skip_rules=["min_total_minutes"])
    assert without_times.everybody is not None
    assert without_times.everybody["reason"].iat[0] == "straight_lining"
    assert len(choose(data_set, apply_rules=False, apply_exclusions=False).participants) == 6


def test_rules_are_applied_to_bots_too(tmp_path: Path) -> None:
    data = tables(mode="bot")
    data["quality"] = [flag("person0", "straight_lining") | {"mode": "bot"}]
    found = select(read(data, tmp_path), mode="bot")
    assert reasons_of(found) == {"person0": "straight_lining"}


def test_rules_that_nobody_can_apply_and_files_that_are_not_the_exported_ones_are_differences(tmp_path: Path) -> None:
    data = tables()
    data["quality"] = [flag("person0", "straight_lining")]
    study = STUDY_FILE.read_bytes().replace(b"[consent]", RULES, 1)
    whole = selected(data, tmp_path / "whole", study)
    assert not any("manifest" in each or "Files that" in each for each in whole.differences)
    del data["quality"]
    bare = selected(data, tmp_path / "bare", study)
    rules = "straight_lining, incomplete, min_total_minutes"
    told = next(each for each in bare.differences if "could not be applied" in each)
    assert set(
        told.removeprefix("Declared exclusion rules could not be applied: ").removesuffix(".").split(", ")
    ) == set(rules.split(", "))


def test_files_and_decisions_beyond_the_declared_rules_are_differences(tmp_path: Path) -> None:
    data = tables()
    data["participants"][1]["excluded_at"] = data["participants"][2]["excluded_at"] = "2031-03-01T09:45:00.000000Z"
    write_exported(tmp_path, data)
    ratings = tmp_path / "data" / "description-ratings_data.csv"
    ratings.write_bytes(ratings.read_bytes().replace(b",5,", b",4,"))
    changed = select(read_dataset(tmp_path, changed_ok=True))
    assert "Outside of the declared rules, researchers excluded 2 participants." in changed.differences
    assert "Files that are not as they were exported: data/description-ratings_data.csv." in changed.differences
    (tmp_path / "manifest.json").unlink()
    loose = select(read_dataset(tmp_path))
    assert loose.differences[0].startswith("The data set has no manifest")
    untouched = selected(tables(), tmp_path / "untouched")
    assert untouched.differences == ()


def test_rules_on_times_are_not_applied_to_bots_because_they_do_not_wait(tmp_path: Path) -> None:
    rows = [flag("person0", "straight_lining"), flag("person1", "min_total_minutes")]
    data, bots = tables(), tables(mode="bot")
    data["quality"], bots["quality"] = rows, [row | {"mode": "bot"} for row in rows]
    of_people = select(read(data, tmp_path / "people"))
    of_bots = select(read(bots, tmp_path / "bots"), mode="bot")
    assert reasons_of(of_people) == {"person0": "straight_lining", "person1": "min_total_minutes"}
    assert reasons_of(of_bots) == {"person0": "straight_lining"}
    assert any("not applied to them: min_total_minutes." in note for note in of_bots.notes)
    assert not any("Bots do not wait" in note for note in of_people.notes)
    assert not any("as it was asked for" in note for note in of_bots.notes)


def test_an_exclusion_after_the_data_were_complete_is_told(data: Tables, tmp_path: Path) -> None:
    data["participants"][4]["excluded_at"] = RATED
    data["decisions"] = [decision("person4", "excluded", 1), decision("person5", "included", 2)]
    notes = selected(data, tmp_path).notes
    late = "Excluded by a researcher after the last participant had finished, when all answers could be seen: person4."
    assert late in notes
    assert "An exclusion was taken back by a researcher: person5." in notes


@settings(max_examples=15)
@given(st.permutations(["full", "subgoals", "random"]), st.permutations(PEOPLE))
def test_who_is_analysed_does_not_depend_on_kinds(kinds: list[str], people: list[str]) -> None:
    renamed = dict(zip(("full", "subgoals", "random"), kinds, strict=True))
    reasons = []
    for is_changed in (False, True):
        data = tables()
        data["quality"] = [flag("person0", "straight_lining")]
        data["participants"][4]["completed_at"] = ""
        data["participants"][5]["excluded_at"] = "2031-03-01T09:45:00.000000Z"
        if is_changed:
            drawn = {row["participant"]: row["assignment"] for row in data["participants"]}
            for row, other in zip(data["participants"], people, strict=True):
                row["assignment"] = drawn[other]
            for row in data["ratings"]:
                row["kind"] = renamed.get(row["kind"], row["kind"])
        with TemporaryDirectory() as folder:
            reasons.append(reasons_of(selected(data, Path(folder))))
    assert reasons[0] == reasons[1] == {"person0": "straight_lining", "person4": INCOMPLETE, "person5": BY_RESEARCHER}


@pytest.mark.parametrize("hidden", ["kind", "draw", "assignment", "arrangement", "rating"])
def test_exclusions_are_not_decided_by_a_table_that_tells_kinds_or_ratings(hidden: str) -> None:
    known = {"is_complete": [True], "is_excluded": [False], "has_rated": [True], "has_answered": [True]}
    people = pd.DataFrame({"participant": ["a"], **known})
    flags = pd.DataFrame({"participant": [], "rule": []}, dtype="str")
    assert list(decide(people, flags, []).analysed) == ["a"]
    with pytest.raises(ValueError, match=f"exclusions are decided without {hidden}"):
        decide(people.assign(**{hidden: "x"}), flags, [])


def test_the_last_correction_stands_and_both_are_listed(data: Tables, tmp_path: Path) -> None:
    # In the paper's study page 1 is the instructions; each trial has a page for the situation and one for its ratings.
    place = {"page": "3", "file": "ratings", "question": "general", "from": "4"}
    data["decisions"] = [
        decision("person0", "corrected", 8, **place, to="5"),
        decision("person0", "corrected", 7, **place, to="1"),
    ]
    found = selected(data, tmp_path, STUDY_FILE.read_bytes())
    assert ratings_of(found, "person0") == {"likeliness": 2, "loveliness": 3, "general": 5}
    assert ratings_of(found, "person0", trial=2)["general"] == 5
    assert [(each.after, each.problem) for each in found.corrections] == [("1", None), ("5", None)]
    raw = selected(data, tmp_path, STUDY_FILE.read_bytes(), apply_corrections=False)
    assert (ratings_of(raw, "person0")["general"], raw.corrections) == (4, ())


def test_a_correction_without_a_study_file_is_made_where_one_answer_alone_fits(data: Tables, tmp_path: Path) -> None:
    one = next(row for row in data["ratings"] if row["participant"] == "person3" and row["item"] == "general")
    values = [row["rating"] for row in data["ratings"] if (row["participant"], row["item"]) == ("person3", "general")]
    place = {"page": "3", "file": "ratings", "question": "general", "from": one["rating"]}
    data["decisions"] = [decision("person3", "corrected", 1, **place, to="2")]
    (correction,) = selected(data, tmp_path).corrections
    fitting = values.count(one["rating"])
    assert correction.problem == (None if fitting == 1 else f"{fitting} answers fit, and their pages are not known")


@pytest.mark.parametrize(
    ("told", "problem"),
    [
        ({"page": "3", "from": "3", "to": "5"}, "the file has '4' there, and not '3'"),
        ({"page": "3", "from": "4", "to": "6"}, "'6' is no rating from 1 to 5"),
        ({"page": "3", "from": "4", "to": ""}, "the value is in the participant's own words and was left out"),
        ({"page": "2", "from": "4", "to": "5", "question": "beauty"}, "no such answer is there"),
        ({"page": "3", "from": "4", "to": "5", "file": "probes"}, "there is no data/description-probes_data.csv"),
    ],
)
def test_a_correction_that_cannot_be_made_is_told_and_changes_nothing(
    told: Row, problem: str, data: Tables, tmp_path: Path
) -> None:
    place = {"file": "ratings", "question": "general"} | told
    data["decisions"] = [decision("person0", "corrected", 1, **place)]
    found = selected(data, tmp_path, STUDY_FILE.read_bytes())
    assert [each.problem for each in found.corrections] == [problem]
    assert any(problem in note for note in found.notes)
    assert ratings_of(found, "person0")["general"] == 4


def test_a_corrected_prediction_is_judged_anew(data: Tables, tmp_path: Path) -> None:
    row = data["ratings"][0]
    probe = {name: row[name] for name in ("study", "study_version", "mode", "participant", "experiment", "trial")}
    probe |= {"layout": row["layout"], "kind": row["kind"], "question": "1", "predicted": "left", "action": "forward"}
    data["probes"] = [probe | {"is_correct": "false", "is_as_good": "false", "confidence": "3"}]
    place = {"page": "9", "file": "probes", "question": "1", "from": "left"}
    data["decisions"] = [decision("person0", "corrected", 1, **place, to="forward")]
    probes = selected(data, tmp_path).data.probes
    assert probes is not None
    assert probes[["predicted", "is_correct", "is_as_good"]].to_numpy().tolist() == [["forward", True, True]]


def test_without_participants_whoever_rated_all_trials_is_analysed_and_that_is_told(
    data: Tables, tmp_path: Path
) -> None:
    data["ratings"] = [row for row in data["ratings"] if row["participant"] != "person2" or row["experiment"] == "1"]
    found = select(read_dataset(write_plain(tmp_path, {"ratings": data["ratings"]})))
    assert found.data.everybody is None
    assert set(found.data.participants["participant"]) == set(PEOPLE) - {"person2"}
    assert any(note.startswith("There is no participants.csv. Everybody who rated as many") for note in found.notes)


def test_of_several_studies_versions_and_modes_one_has_to_be_named(tmp_path: Path) -> None:
    several = [
        tables(),
        tables(mode="bot"),
        tables(study_version="5e" * 32),
        tables(study="mine", study_version="6f" * 32),
    ]
    together = {name: [row for each in several for row in each[name]] for name in several[0]}
    data_set = read(together, tmp_path)
    with pytest.raises(DataSetError) as error:
        select(data_set)
    assert str(error.value) == (
        "there are data of several: mine 6f6f6f6f6f6f mode live (6 participants); sakai2021 4d4d4d4d4d4d mode live "
        "(6 participants); sakai2021 5e5e5e5e5e5e mode live (6 participants); choose one with --version"
    )
    assert select(data_set, study="mine").data.study_version == "6f" * 32
    assert len(select(data_set, version="5e").data.ratings) == 90
    with pytest.raises(
        DataSetError, match=r"^there are no data of mine mode bot; there are: mine 6f6f6f6f6f6f mode live"
    ):
        select(data_set, study="mine", mode="bot")


def test_bots_are_not_analysed_unless_asked_for(tmp_path: Path) -> None:
    data_set = read(tables(mode="bot"), tmp_path)
    with pytest.raises(DataSetError, match=r"mode bot \(6 participants\); choose another with --mode$"):
        select(data_set)


@pytest.mark.parametrize(
    ("asked", "told", "option"),
    [
        ({"study": "nope"}, "a study 'nope'", "--study"),
        ({"version": "zz"}, "a version that begins with 'zz'", "--version"),
        ({"study": "sakai2021", "version": "4d", "mode": "bot"}, "sakai2021 4d mode bot", "--mode"),
    ],
)
def test_what_is_not_there_is_told_with_what_is_and_with_the_option_that_asked_for_it(
    asked: dict[str, str], told: str, option: str, data: Tables, tmp_path: Path
) -> None:
    with pytest.raises(DataSetError) as error:
        choose(read(data, tmp_path), asked.get("study"), asked.get("version"), asked.get("mode"))
    there = "sakai2021 4d4d4d4d4d4d mode live (6 participants)"
    assert str(error.value) == f"there are no data of {told}; there are: {there}; choose another with {option}"


def test_bots_that_are_asked_for_are_analysed(tmp_path: Path) -> None:
    data_set = read(tables(mode="bot"), tmp_path)
    assert select(data_set, mode="bot").data.mode == "bot"


@pytest.mark.parametrize("people", [("one",), tuple(f"p{number:04}" for number in range(400))])
def test_one_participant_or_many_are_chosen_alike(people: tuple[str, ...], tmp_path: Path) -> None:
    chosen = selected(tables(people), tmp_path).data
    assert list(chosen.participants["participant"]) == list(people)


def test_nobody_left_is_told_and_leaves_empty_tables(data: Tables, tmp_path: Path) -> None:
    for row in data["participants"]:
        row["completed_at"] = ""
    found = selected(data, tmp_path)
    assert (len(found.data.ratings), len(found.data.participants)) == (0, 0)
    assert next(iter(found.data.ratings.columns)) == "participant"
    assert "Nobody is left to be analysed." in found.notes


def test_ratings_that_are_all_equal_are_read_and_chosen(data: Tables, tmp_path: Path) -> None:
    for row in data["ratings"]:
        row["rating"] = "3"
    assert set(selected(data, tmp_path).data.ratings["rating"]) == {3}
