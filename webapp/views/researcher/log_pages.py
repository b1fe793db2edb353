"""The log of everything that happened, in words, and the proof that it was not changed."""

from typing import get_args

from flask import abort, render_template, request
from flask.typing import ResponseReturnValue

from webapp.storage.dashboard import RecordLine, latest_records
from webapp.storage.records import Action
from webapp.storage.verification import Verification, verify_log
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import look
from webapp.views.researcher.sentences import sentence
from webapp.views.services import services

PER_PAGE = 200

_BY_PARTICIPANTS: tuple[Action, ...] = ("consented", "attempted", "acted", "sent", "withdrew")
_BY_RESEARCHERS: tuple[Action, ...] = (
    *("excluded", "included", "corrected", "noted", "page_released", "page_restarted", "link_made", "erased"),
    *("unblinded", "person_unblinded", "downloaded", "published", "revealed"),
)
_BY_ACCOUNTS: tuple[Action, ...] = (
    "created",
    "role_changed",
    "password_changed",
    "disabled",
    "signed_in",
    "signed_out",
    "sessions_revoked",
)
GROUPS: dict[str, tuple[Action, ...]] = {
    "participants": _BY_PARTICIPANTS,
    "decisions": _BY_RESEARCHERS,
    "accounts": _BY_ACCOUNTS,
    "allocation": ("allocated", "slot_released", "slot_resumed", "served"),
}
"""The kinds of records to choose from."""

GROUP_NAMES = {
    "participants": "What participants did",
    "decisions": "What researchers did",
    "accounts": "Accounts and signing in",
    "allocation": "Allocation",
}


@bp.get("/records")
def log() -> ResponseReturnValue:
    """Show the latest records."""
    return _page(None)


@bp.post("/records/verify")
def verify() -> ResponseReturnValue:
    """Check the whole log and every row that it vouches for; nothing is changed."""
    return _page(verify_log(services().database))


def _page(verification: Verification | None) -> str:
    chosen, before = request.args.get("show", ""), request.args.get("before", "")
    if not (chosen in {"", *GROUPS, *get_args(Action)} and (before.isdecimal() or not before)):
        abort(404)
    actions = GROUPS.get(chosen) or tuple(action for action in get_args(Action) if action == chosen) or None
    lines = latest_records(services().database, actions, int(before[:12]) if before else None, PER_PAGE)
    return render_template(
        "researcher/log.html",
        lines=lines,
        words=_words,
        groups=GROUP_NAMES,
        chosen=chosen,
        before=before,
        is_full=len(lines) == PER_PAGE,
        verification=verification,
    )


def _words(line: RecordLine) -> str:
    """Return what happened, with nothing of trials unless their arms are seen."""
    scope = look().scope
    sees = look().mask.is_open and (line.mode, line.study_version) == (scope.mode, scope.study_version)
    if line.action == "sent" and line.actor != "participant":
        return f"page {line.page} was stored with nothing on it"
    return sentence(line.action, line.page, line.part, line.detail, sees=sees)
