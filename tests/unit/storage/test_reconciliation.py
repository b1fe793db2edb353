import json
from pathlib import Path

import pytest

from tests.unit.storage.people import enrol_somebody, walk
from tests.web.bundles import read_study, write_bundle
from webapp.storage.database import Database
from webapp.storage.reconciliation import MAX_BYTES, Reconciliation, decoded, reconcile, reconcile_file
from webapp.storage.wanted import bundles_in
from webapp.study.reconciliation import ReconciliationError
from webapp.study.recruitment import Recruit
from webapp.study.sections import Recruitment, ReturnPath

STUDY = read_study(recruitment=Recruitment(service="prolific", completed=ReturnPath(code="DONE1234")))
HEADINGS = "Submission id,Participant id,Status,Completion code\n"
LIST = (
    HEADINGS + "session00000a,a,APPROVED,DONE1234\n"
    "session00000b,b,APPROVED,NOCODE\n"
    "session00000c,c,AWAITING REVIEW,GUESSED\n"
    "session00000x,x,APPROVED,DONE1234\n"
    "session00000y,x,RETURNED,\n"
)


@pytest.fixture
def sent(database: Database) -> Database:
    """Four people sent by Prolific: `a` and `c` have finished, `b` and `d` have not."""
    version = write_bundle(database.path.parent, STUDY)
    for name in "abcd":
        recruit = Recruit("prolific", name, "study", f"session00000{name}")
        person = enrol_somebody(database, "live", version, study=STUDY, recruit=recruit)
        walk(database, person, person.num_pages if name in "ac" else 2, study=STUDY)
    enrol_somebody(database, "test", version, study=STUDY, recruit=Recruit("prolific", "e", "study", "session00000e"))
    return database


def told(found: Reconciliation) -> dict[str, list[str]]:
    return {group.finding: [one.external_id for one in group.people] for group in found.groups if group.people}


def test_a_list_is_compared_with_whom_the_recruiter_sent(sent: Database) -> None:
    found = reconcile(sent, STUDY.name, "live", LIST, find_bundle=bundles_in(sent.path.parent))
    assert told(found) == {
        "missing": ["x"],
        "extra": ["d"],
        "paid_incomplete": ["b"],
        "wrong_code": ["c"],
    }
    assert (found.num_theirs, found.num_ours, found.num_agreeing, found.num_problems) == (4, 4, 1, 4)


def test_without_the_bundle_codes_are_not_compared(sent: Database) -> None:
    assert "wrong_code" not in told(reconcile(sent, STUDY.name, "live", LIST))


def test_only_the_asked_for_participants_are_compared(sent: Database) -> None:
    assert told(reconcile(sent, STUDY.name, "test", HEADINGS)) == {"extra": ["e"]}
    assert told(reconcile(sent, "other", "live", HEADINGS)) == {}


def test_a_file_is_read_and_the_only_study_is_found(sent: Database, tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text(LIST, encoding="utf-8-sig")
    found = reconcile_file(sent, sent.path.parent, path, None, "live", None)
    assert found.study == STUDY.name
    as_json = json.loads(json.dumps(found.as_json()))
    assert as_json["num_problems"] == 4
    assert [one["external_id"] for one in as_json["findings"]["extra"]] == ["d"]


@pytest.mark.parametrize(
    ("study", "mode", "message"),
    [
        ("other", "live", "nobody was sent to the study 'other' in mode live; studies with such people: sakai2021"),
        (None, "bot", "use --study: studies with people sent by a recruiter, mode bot: none"),
    ],
)
def test_a_study_that_is_not_clear_is_asked_for(
    sent: Database, tmp_path: Path, study: str | None, mode: str, message: str
) -> None:
    (tmp_path / "export.csv").write_text(LIST, encoding="utf-8")
    with pytest.raises(ReconciliationError) as refusal:
        reconcile_file(sent, sent.path.parent, tmp_path / "export.csv", study, mode, None)
    assert str(refusal.value) == message


def test_a_file_that_cannot_be_read_is_told_in_one_line(sent: Database, tmp_path: Path) -> None:
    with pytest.raises(ReconciliationError, match=r"missing\.csv: No such file"):
        reconcile_file(sent, sent.path.parent, tmp_path / "missing.csv", None, "live", None)
    with pytest.raises(ReconciliationError, match="not in UTF-8"):
        decoded("Participant id\nJürgen\n".encode("latin-1"))
    with pytest.raises(ReconciliationError, match=f"{MAX_BYTES} are the most"):
        decoded(b"x" * (MAX_BYTES + 1))
