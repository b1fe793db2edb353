"""Which parts of the program are changed on purpose, and which tests ought to notice."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

SHARE_TO_REACH = 0.85
"""Of the mutants of each area, so many must be killed."""


@dataclass(frozen=True, slots=True)
class Area:
    """Modules that do one thing together.

    Attributes:
        name: What they do.
        tests: For each module the tests that are run against its mutants, quickest first.
    """

    name: str
    tests: Mapping[str, Sequence[str]]


_STORED_PAGES = (
    "tests/unit/storage/test_answers.py",
    "tests/unit/storage/test_attempts.py",
    "tests/unit/storage/test_drives.py",
    "tests/unit/storage/test_submission_limits.py",
    "tests/unit/storage/test_people.py",
)
_SENT_PAGES = (
    "tests/unit/views/test_page_forms.py",
    "tests/web/test_between_two_tabs.py",
    "tests/web/test_sending_again.py",
    "tests/web/test_participant_pages.py",
    "tests/web/test_around_the_trials.py",
)
_ALLOCATED = (
    "tests/unit/study/test_counterbalancing.py",
    "tests/unit/storage/test_allocation_limits.py",
    "tests/unit/storage/test_enrolment.py",
    "tests/unit/storage/test_ledger.py",
)
_SIGNED_IN = (
    "tests/web/test_sign_in_pages.py",
    "tests/security/test_sign_in.py",
    "tests/web/test_researcher_pages.py",
)

AREAS: Sequence[Area] = (
    Area(
        "allocation of conditions",
        {
            "webapp/study/counterbalancing.py": _ALLOCATED,
            "webapp/study/draws.py": _ALLOCATED,
            "webapp/storage/ledger.py": _ALLOCATED,
            "webapp/storage/enrolment.py": _ALLOCATED,
        },
    ),
    Area(
        "submission of a page",
        {
            "webapp/study/session.py": ("tests/unit/study/test_session.py", "tests/unit/storage/test_answers.py"),
            "webapp/study/answers.py": ("tests/unit/study/test_answers.py",),
            "webapp/storage/answers.py": _STORED_PAGES,
            "webapp/storage/answer_rows.py": _STORED_PAGES,
            "webapp/storage/restarts.py": _STORED_PAGES,
            "webapp/views/participant.py": (*_SENT_PAGES, "tests/web/test_recruitment.py"),
            "webapp/views/forms.py": _SENT_PAGES,
            "webapp/views/answering.py": _SENT_PAGES,
        },
    ),
    Area(
        "export escaping",
        {
            "webapp/storage/csv_files.py": (
                "tests/unit/storage/test_csv_buffering.py",
                "tests/unit/storage/test_csv_files.py",
                "tests/unit/storage/test_exports.py",
            )
        },
    ),
    Area(
        "sign-in",
        {
            "webapp/storage/passwords.py": (
                "tests/unit/storage/test_password_limits.py",
                "tests/security/test_passwords.py",
            ),
            "webapp/storage/researchers.py": (
                "tests/unit/storage/test_researchers.py",
                "tests/unit/storage/test_sign_in_limits.py",
                "tests/security/test_sign_in.py",
            ),
            "webapp/views/tokens.py": ("tests/unit/views/test_token_formats.py", "tests/unit/views/test_tokens.py"),
            "webapp/views/researcher/signing_in.py": _SIGNED_IN,
            "webapp/views/researcher/door.py": _SIGNED_IN,
        },
    ),
)
