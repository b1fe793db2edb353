"""The recruiter's list against ours: who is missing, extra, there twice, paid without having finished.

The list is a CSV file as Prolific and SONA write it, or any other with a column of people's ids.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

from webapp.study.sections import Recruitment

OurState = Literal["in_progress", "completed", "withdrawn", "screened_out"]
Payment = Literal["paid", "awaiting", "unpaid"]

Finding = Literal[
    "missing", "extra", "paid_incomplete", "complete_unpaid", "wrong_code", "other_submission", "duplicated", "to_pay"
]
FINDINGS: tuple[Finding, ...] = get_args(Finding)
"""The most urgent first; a person stands under the first that is true of them."""

NO_PROBLEM: frozenset[Finding] = frozenset({"to_pay"})
"""What is told and is no disagreement."""

TITLES: Mapping[Finding, str] = {
    "missing": "In the file and not here",
    "extra": "Here and not in the file",
    "paid_incomplete": "Paid and not complete here",
    "complete_unpaid": "Complete here and not paid",
    "wrong_code": "With another code than they were shown here",
    "other_submission": "Here with another submission than in the file",
    "duplicated": "More than once in the file",
    "to_pay": "Complete here and waiting to be paid",
}
ADVICE: Mapping[Finding, str] = {
    "missing": "they say that they took part; ask them, and look at what the recruiter's link holds",
    "extra": "they came by a link, and the recruiter does not list them; is the file of this study, and of today?",
    "paid_incomplete": "they got paid, and did not send the last page",
    "complete_unpaid": "they sent the last page, and the recruiter will not pay them unless you do something",
    "wrong_code": "the code does not belong to how their part ended here",
    "other_submission": "the person is the same, the submission is not",
    "duplicated": "the recruiter lists several submissions; only one can have been the person's first",
    "to_pay": "approve them",
}

_ID = ("participantid", "prolificpid", "prolificid", "surveycode", "surveyid", "idcode", "sonaid", "id", "label")
_SESSION = ("submissionid", "sessionid")
_STATUS = ("status", "creditstatus", "participationstatus")
_CODE = ("completioncode", "enteredcode", "studycode")
"""The headings of columns, in small letters and without blanks, dashes and the like, the likeliest first."""

_PAYMENTS: Mapping[str, Payment] = {
    "APPROVED": "paid",
    "PARTIALLY APPROVED": "paid",
    "PAID": "paid",
    "CREDIT GRANTED": "paid",
    "PARTICIPATED": "paid",
    "AWAITING REVIEW": "awaiting",
    "AWAITING ACTION": "awaiting",
}
_NO_CODES = frozenset({"", "NOCODE"})
"""What Prolific's list holds where no code was entered."""

_MAX_TOLD = 10
"""How many submissions of one person are told about."""

_ENDINGS: tuple[OurState, ...] = ("completed", "screened_out", "withdrawn")


class ReconciliationError(ValueError):
    """A file that cannot be compared; the message says what was found and what is wanted."""


@dataclass(frozen=True, slots=True)
class Submission:
    """A line of the recruiter's list.

    Attributes:
        external_id: The person's id there.
        session: The submission's id there; None where the file has none.
        status: What became of it, in the recruiter's words; None where the file has no such column.
        code: The code that was entered; None where the file has no such column.
    """

    external_id: str
    session: str | None = None
    status: str | None = None
    code: str | None = None

    @property
    def payment(self) -> Payment:
        """Whether it was paid; a list without statuses is taken for one of people who were."""
        if self.status is None:
            return "paid"
        return _PAYMENTS.get(re.sub(r"[\s_-]+", " ", self.status).strip().upper(), "unpaid")

    @property
    def words(self) -> str:
        """The line in short."""
        return ", ".join(part for part in (self.session, self.status, self.code and f"code {self.code}") if part)


@dataclass(frozen=True, slots=True)
class OurPerson:
    """Whom a recruiter sent, as we know it.

    Attributes:
        external_id: The person's id there.
        code: The participant's code here.
        state: Where the participant is.
        session: The submission's id there; None where the service has none.
        right_codes: The codes that the participant may have entered, in capitals; None where that is not known.
    """

    external_id: str
    code: str
    state: OurState
    session: str | None = None
    right_codes: frozenset[str] | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """A person about whom the two lists differ.

    Attributes:
        finding: In what, the most urgent of it.
        external_id: The person's id at the recruiter.
        code: The participant's code here; None for whoever is not here.
        words: What the lists say, and what else is true of the person.
    """

    finding: Finding
    external_id: str
    code: str | None
    words: str


def read_list(text: str, id_column: str | None = None) -> tuple[Submission, ...]:
    """Read the recruiter's list.

    Args:
        text: A CSV file with headings; separated by commas, semicolons or tabs, with or without a byte order mark.
        id_column: The heading of the column of people's ids, where it is none of the known ones.

    Raises:
        ReconciliationError: There is no such column, or a row has more fields than there are headings. Rows are
            counted as a spreadsheet shows them, blank ones included.
    """
    whole = text.removeprefix("\ufeff")
    lines = whole.lstrip("\r\n")
    num_blank = len(whole.removesuffix(lines).splitlines())
    names = _ID if id_column is None else (_plain(id_column),)
    reader = csv.reader(io.StringIO(lines, newline=""), delimiter=_separator(lines, names))
    try:
        headings = [heading.strip() for heading in next(reader, [])]
        rows = [(number, row) for number, row in enumerate(reader, num_blank + 2) if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise ReconciliationError(f"the file is no CSV: {error}") from None
    who = _id_place(headings, names, id_column)
    others = [_place(headings, names) for names in (_SESSION, _STATUS, _CODE)]
    found: list[Submission] = []
    for number, row in rows:
        if any(cell.strip() for cell in row[len(headings) :]):
            raise ReconciliationError(f"row {number} has {len(row)} fields, and there are {len(headings)} headings")
        cells = [cell.strip() for cell in row] + [""] * (len(headings) - len(row))
        if not cells[who]:
            raise ReconciliationError(f"row {number} has nothing in the column {headings[who]!r}")
        found.append(Submission(cells[who], *(None if place is None else cells[place] for place in others)))
    return tuple(found)


def compare(theirs: Sequence[Submission], ours: Sequence[OurPerson]) -> tuple[Found, ...]:
    """Tell about whom the two lists differ, each person once, in the order of `FINDINGS`, then of ids."""
    people = {person.external_id: person for person in ours}
    listed: dict[str, list[Submission]] = {}
    for submission in theirs:
        listed.setdefault(submission.external_id, []).append(submission)
    found = [*_only_theirs(listed, people), *_only_ours(listed, people)]
    for external_id, submissions in listed.items():
        person = people.get(external_id)
        if len(submissions) > 1:
            words = _all_words(submissions, "without a status")
            found.append(Found("duplicated", external_id, None if person is None else person.code, words))
        if person is not None:
            found += _differences(person, submissions)
    return _once(sorted(found, key=lambda one: (FINDINGS.index(one.finding), one.external_id)))


def right_codes(recruitment: Recruitment | None, state: OurState) -> frozenset[str] | None:
    """Return the codes, in capitals, that somebody in a state may have entered; None where the study shows no codes."""
    shown = {} if recruitment is None else {ending: getattr(recruitment, ending).code for ending in _ENDINGS}
    if not any(shown.values()):
        return None
    code = shown.get(state)
    return frozenset(() if code is None else (code.upper(),))


def _once(found: Iterable[Found]) -> tuple[Found, ...]:
    """Return the first finding about each person, with the titles of the others."""
    told: dict[str, Found] = {}
    for one in found:
        first = told.setdefault(one.external_id, one)
        if first is not one:
            also = f"{first.words}; also: {TITLES[one.finding].lower()}"
            told[one.external_id] = replace(first, words=also)
    return tuple(told.values())


def _only_theirs(listed: Mapping[str, Sequence[Submission]], people: Mapping[str, OurPerson]) -> Iterator[Found]:
    for external_id, submissions in listed.items():
        claims = [submission for submission in submissions if submission.payment != "unpaid"]
        if external_id not in people and claims:
            yield Found("missing", external_id, None, _all_words(claims))


def _only_ours(listed: Mapping[str, Sequence[Submission]], people: Mapping[str, OurPerson]) -> Iterator[Found]:
    for external_id, person in people.items():
        if external_id not in listed:
            yield Found("extra", external_id, person.code, f"{_told(person.state)} here")


def _differences(person: OurPerson, submissions: Sequence[Submission]) -> Iterator[Found]:
    payments = Counter(submission.payment for submission in submissions)
    words = _all_words(submissions)

    def told(finding: Finding, what: str) -> Found:
        return Found(finding, person.external_id, person.code, ", ".join(part for part in (what, words) if part))

    if payments["paid"] and person.state != "completed":
        yield told("paid_incomplete", f"{_told(person.state)} here")
    if person.state == "completed" and not payments["paid"]:
        yield told("to_pay" if payments["awaiting"] else "complete_unpaid", "")
    # Whoever entered none, as by the button that leads back, entered no other one.
    entered = {one.code.upper() for one in submissions if one.code and one.payment != "unpaid"} - _NO_CODES
    if entered and person.right_codes is not None and entered.isdisjoint(person.right_codes):
        shown = ", ".join(sorted(person.right_codes)) or "no code"
        yield told("wrong_code", f"was shown {shown}")
    sessions = {one.session for one in submissions if one.session}
    if sessions and person.session is not None and person.session not in sessions:
        yield told("other_submission", f"came with {person.session}")


def _all_words(submissions: Sequence[Submission], unless: str = "") -> str:
    told = [submission.words or unless for submission in submissions[:_MAX_TOLD]]
    more = len(submissions) - len(told)
    return "; ".join([*told, f"and {more} more"] if more else told)


def _told(state: OurState) -> str:
    return state.replace("_", " ")


def _separator(lines: str, names: Sequence[str]) -> str:
    """Return what separates the headings: that with which one of the names is found, else what is there most often."""
    first = lines.splitlines()[0] if lines else ""
    outside = re.sub(r'"[^"]*"', "", first)

    def likelihood(separator: str) -> tuple[bool, int]:
        headings = next(csv.reader([first], delimiter=separator), [])
        return _place(headings, names) is not None, outside.count(separator)

    return max(",;\t", key=likelihood)


def _id_place(headings: Sequence[str], names: Sequence[str], id_column: str | None) -> int:
    place = _place(headings, names)
    if place is None:
        wanted = "Participant id (Prolific), or another with --id-column" if id_column is None else repr(id_column)
        listed = ", ".join(repr(heading) for heading in headings if heading) or "none"
        raise ReconciliationError(f"the file has no column of people's ids; wanted: {wanted}; its columns: {listed}")
    return place


def _place(headings: Sequence[str], names: Sequence[str]) -> int | None:
    plain = [_plain(heading) for heading in headings]
    return next((plain.index(name) for name in names if name in plain), None)


def _plain(heading: str) -> str:
    return re.sub(r"[\s_.-]+", "", heading.casefold())
