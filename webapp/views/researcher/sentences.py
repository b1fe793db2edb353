"""The log in words."""

from collections.abc import Mapping
from typing import Any

from webapp.storage.records import Action

_WORDS: Mapping[Action, str] = {
    "consented": "agreed to take part",
    "attempted": "answered the quiz{on_page}, attempt {part}",
    "acted": "steered the agent{on_page}, action {part}",
    "sent": "{the_page} was sent",
    "withdrew": "left the study",
    "allocated": "a place in the study was drawn",
    "slot_released": "the place went back: {why}",
    "slot_resumed": "came back late; their place counts again",
    "served": "the study was opened to participants",
    "excluded": "excluded{because}",
    "included": "took the exclusion back{because}",
    "corrected": "corrected {question}{on_page} from “{from}” to “{to}”{because}",
    "noted": "noted: “{text}”",
    "page_released": "released {the_page}{because}",
    "page_restarted": "let {the_page} begin anew{because}",
    "link_made": "made a new personal link{because}",
    "erased": "erased a participant",
    "unblinded": "unblinded the arms{because}",
    "person_unblinded": "looked at what a participant saw{because}",
    "downloaded": "downloaded {file}",
    "published": "published a version of the study",
    "created": "made the account {account} ({role})",
    "role_changed": "made {account} {role}",
    "password_changed": "gave {account} another password",
    "disabled": "closed the account {account}",
    "signed_in": "signed in",
    "signed_out": "signed out",
    "sessions_revoked": "ended {sessions} of {account}",
    "revealed": "revealed the results",
}
_WHY = {
    "expired": "no sign of life within the lease",
    "withdrawn": "they left",
    "screened_out": "they were screened out",
    "erased": "they were erased",
}
RECONCILIATION = "reconciliation"
"""How comparing the recruiter's list stands in the log: the page shows what recruits.csv holds."""

_GONE = "…"
"""What stands for something that was erased."""


def sentence(
    action: Action, page: int | None, part: int | None, detail: Mapping[str, Any], *, sees: bool = True
) -> str:
    """Return what happened, without who did it. What was drawn for a participant is never among it.

    Args:
        action: What.
        page: The page it is about, if any.
        part: The number of the attempt or of the drive's action, if any.
        detail: What was recorded besides.
        sees: Whether the reader may know what the participant answered in trials.
    """
    if action == "corrected" and not sees and detail.get("file", "answers") != "answers":
        return f"corrected a value on page {page}: “{detail.get('reason', _GONE)}”"
    if action == "downloaded" and detail.get("file") == RECONCILIATION:
        return "compared the recruiter's list, which shows ids beside codes"
    told: dict[str, object] = {name: detail.get(name, _GONE) for name in _TOLD}
    told["why"] = _WHY.get(str(detail.get("why")), _GONE)
    told["part"] = part
    told["the_page"] = "a page" if page is None else f"page {page}"
    told["sessions"] = "1 session" if detail.get("ended") == 1 else f"{told['ended']} sessions"
    told["on_page"] = "" if page is None else f" on page {page}"
    told["because"] = f": “{detail['reason']}”" if "reason" in detail else ""
    return _WORDS[action].format_map(told)


_TOLD = ("question", "from", "to", "text", "file", "account", "role", "ended")
