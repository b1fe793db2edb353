from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.study.reconciliation import (
    FINDINGS,
    OurPerson,
    OurState,
    ReconciliationError,
    Submission,
    compare,
    read_list,
    right_codes,
)
from webapp.study.sections import Recruitment, ReturnPath

PROLIFIC = (
    "Submission id,Participant id,Status,Custom study tncs accepted at,Started at,Completion code,Total approvals\n"
    "s1,p1,APPROVED,Not Applicable,2031-03-01T09:30:00Z,DONE1234,12\n"
    "s2,p2,TIMED-OUT,Not Applicable,2031-03-01T09:31:00Z,,3\n"
)
BOTH = (Submission("p1", "s1", "APPROVED", "DONE1234"), Submission("p2", "s2", "TIMED-OUT", ""))
RECRUITMENT = Recruitment(
    service="prolific", completed=ReturnPath(code="DONE1234"), screened_out=ReturnPath(code="QUIZ")
)


def person(external_id: str, state: OurState = "completed", session: str | None = None) -> OurPerson:
    return OurPerson(external_id, f"code-{external_id}", state, session, right_codes(RECRUITMENT, state))


def findings(theirs: list[Submission], *ours: OurPerson) -> list[tuple[str, str]]:
    return [(found.finding, found.external_id) for found in compare(theirs, ours)]


@pytest.mark.parametrize(
    "text",
    [
        PROLIFIC,
        "\ufeff" + PROLIFIC,
        PROLIFIC.replace(",", ";"),
        "\n\n" + PROLIFIC.replace(",12\n", ",12,\n\n").replace(",3\n", ",3, ,,\n"),
        PROLIFIC.replace(",", "\t"),
        PROLIFIC.replace("\n", "\r\n") + "\r\n ,,\r\n",
        PROLIFIC.replace("Submission id", "session_id").replace("Participant id", "participant_id"),
        PROLIFIC.replace("Completion code", "entered_code").replace("Status", " STATUS "),
        PROLIFIC.replace("Participant id", '"PROLIFIC_PID"'),
    ],
)
def test_prolifics_list_is_read_in_every_spelling_it_has_had(text: str) -> None:
    assert read_list(text) == BOTH


def test_a_list_of_ids_alone_is_one_of_people_who_were_paid() -> None:
    (submission,) = read_list("Survey ID\n77\n")
    assert (submission, submission.payment) == (Submission("77"), "paid")


def test_a_column_can_be_named_where_its_heading_is_an_unknown_one() -> None:
    assert read_list("Matrikel;Name, first and last\n4711;Ann\n", "matrikel") == (Submission("4711"),)
    assert read_list("名前,番号\nアン,4711\n", "番号") == (Submission("4711"),)
    for column, wanted in ((None, r"Participant id .*--id-column"), ("Number", "'Number'")):
        with pytest.raises(ReconciliationError, match=rf"wanted: {wanted}; its columns: 'Matrikel', 'Name'"):
            read_list("Matrikel;Name\n4711;Ann\n", column)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "its columns: none"),
        ("\n\n", "its columns: none"),
        ("<html>\n", "its columns: '<html>'"),
        ("Participant id,Status\np1,APPROVED,more\n", "row 2 has 3 fields, and there are 2 headings"),
        ("Participant id,Status\np1,APPROVED\n,APPROVED\n", "row 3 has nothing in the column 'Participant id'"),
        ("\r\n\nParticipant id,Status\n\np1,APPROVED\n\n,APPROVED\n", "row 7 has nothing in the column"),
        ("Participant id,Status\n\n\np1,APPROVED,,more\n", "row 4 has 4 fields, and there are 2 headings"),
        ('Participant id,Status\np1,"AP\nPROVED"\n,APPROVED\n', "row 3 has nothing in the column"),
    ],
)
def test_a_file_that_cannot_be_compared_is_told_in_one_line(text: str, told: str) -> None:
    with pytest.raises(ReconciliationError) as refusal:
        read_list(text)
    assert told in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("status", "payment"),
    [
        ("APPROVED", "paid"),
        ("Partially_approved", "paid"),
        ("AWAITING REVIEW", "awaiting"),
        ("awaiting-review", "awaiting"),
        ("RETURNED", "unpaid"),
        ("TIMED-OUT", "unpaid"),
        ("something new", "unpaid"),
    ],
)
def test_a_status_says_who_was_paid(status: str, payment: str) -> None:
    assert Submission("p", status=status).payment == payment


def test_who_agrees_is_not_told() -> None:
    assert compare([Submission("p1", "s1", "APPROVED", "done1234")], [person("p1", session="s1")]) == ()


def test_whoever_says_that_they_took_part_and_did_not_is_missing() -> None:
    theirs = [Submission(f"p{number}", None, status) for number, status in enumerate(("APPROVED", "AWAITING REVIEW"))]
    assert findings(theirs) == [("missing", "p0"), ("missing", "p1")]


@pytest.mark.parametrize("status", ["RETURNED", "TIMED-OUT", "REJECTED"])
def test_whoever_never_began_here_and_asks_for_nothing_is_not(status: str) -> None:
    assert findings([Submission("p1", None, status)]) == []


def test_whoever_is_here_alone_is_extra() -> None:
    (found,) = compare([], [person("p1", "in_progress")])
    assert (found.finding, found.code, found.words) == ("extra", "code-p1", "in progress here")


def test_whoever_is_listed_twice_is_told_with_both_lines() -> None:
    theirs = [Submission("p1", "s1", "RETURNED"), Submission("p1", "s2", "APPROVED")]
    (found,) = compare(theirs, [person("p1", session="s2")])
    assert (found.finding, found.words) == ("duplicated", "s1, RETURNED; s2, APPROVED")


def test_of_many_lines_about_one_person_only_the_first_are_told() -> None:
    theirs = [Submission("p1", f"s{number}", "APPROVED") for number in range(1000)]
    (missing,) = compare(theirs, [])
    assert missing.words.endswith("; s9, APPROVED; and 990 more; also: more than once in the file")


@pytest.mark.parametrize("state", ["in_progress", "withdrawn", "screened_out"])
def test_whoever_was_paid_and_has_not_finished_is_told(state: OurState) -> None:
    (found,) = compare([Submission("p1", None, "APPROVED")], [person("p1", state)])
    assert (found.finding, found.words) == ("paid_incomplete", f"{state.replace('_', ' ')} here, APPROVED")


def test_whoever_finished_and_will_not_be_paid_is_told_apart_from_whoever_waits() -> None:
    theirs = [Submission("p1", None, "TIMED-OUT"), Submission("p2", None, "AWAITING REVIEW")]
    assert findings(theirs, person("p1"), person("p2")) == [("complete_unpaid", "p1"), ("to_pay", "p2")]


@pytest.mark.parametrize(
    ("state", "entered", "is_right"),
    [
        ("completed", "DONE1234", True),
        ("completed", "QUIZ", False),
        ("completed", "NOCODE", True),
        ("completed", "", True),
        ("screened_out", "QUIZ", True),
        ("screened_out", "DONE1234", False),
        ("in_progress", "DONE1234", False),
        ("in_progress", "NOCODE", True),
        ("withdrawn", "", True),
    ],
)
def test_a_code_that_belongs_to_another_ending_is_told(state: OurState, entered: str, *, is_right: bool) -> None:
    theirs = [Submission("p1", None, "AWAITING REVIEW", entered)]
    assert (("wrong_code", "p1") not in findings(theirs, person("p1", state))) == is_right


def test_a_person_is_told_about_once_under_what_is_most_urgent() -> None:
    theirs = [Submission("p1", "s1", "AWAITING REVIEW", "WRONG"), Submission("p1", "s2", "AWAITING REVIEW", "WRONG")]
    (found,) = compare(theirs, [person("p1", session="s9")])
    assert (found.finding, found.code) == ("wrong_code", "code-p1")
    assert found.words.startswith("was shown DONE1234, s1")
    others = "; also: here with another submission than in the file; also: more than once in the file"
    assert found.words.endswith(f"{others}; also: complete here and waiting to be paid")


def test_codes_are_not_compared_where_the_study_shows_none_or_is_not_known() -> None:
    assert right_codes(None, "completed") is None
    assert right_codes(Recruitment(service="sona"), "completed") is None
    theirs = [Submission("p1", None, "APPROVED", "anything")]
    assert compare(theirs, [OurPerson("p1", "code", "completed")]) == ()


def test_another_submission_of_the_same_person_is_told() -> None:
    assert findings([Submission("p1", "s1", "APPROVED")], person("p1", session="s9")) == [("other_submission", "p1")]


STATES: st.SearchStrategy[OurState] = st.sampled_from(get_args(OurState))
PEOPLE = st.dictionaries(st.sampled_from("abcdefgh"), STATES).map(lambda drawn: [person(*one) for one in drawn.items()])
LISTED = st.lists(
    st.builds(
        Submission, st.sampled_from("abcdefgh"), status=st.sampled_from(["APPROVED", "AWAITING REVIEW", "RETURNED"])
    )
)


@given(theirs=LISTED, ours=PEOPLE)
def test_everybody_is_told_about_or_agrees(theirs: list[Submission], ours: list[OurPerson]) -> None:
    found = compare(theirs, ours)
    assert [FINDINGS.index(one.finding) for one in found] == sorted(FINDINGS.index(one.finding) for one in found)
    told = {one.external_id for one in found}
    assert len(told) == len(found)
    for one in ours:
        payments = {submission.payment for submission in theirs if submission.external_id == one.external_id}
        if one.external_id not in told:
            assert payments == ({"paid"} if one.state == "completed" else payments - {"paid"})
            assert payments
    for submission in theirs:
        if submission.payment != "unpaid" and submission.external_id not in {one.external_id for one in ours}:
            assert submission.external_id in told
