"""The log in words."""

from collections.abc import Mapping
from typing import Any

from webapp.storage.records import Action

_WORDS: Mapping[Action, str] = {
    "consented": "agreed to take part",
    "attempted": "answered the quiz{on_page}, attempt {part}",
    "acted": "steered the agent{on_page}, action {part}",
    "sent": "page {page} was sent",
    "withdrew": "left the study",
    "allocated": "a place in the study was drawn",
    "slot_released": "the place went back: {why}",
    "slot_resumed": "came back late; their place counts again",
    "served": "the study was opened to participants",
    "excluded": "excluded{because}",
    "included": "took the exclusion back{because}",
    "corrected": "corrected {question}{on_page} from “{from}” to “{to}”{because}",
    "noted": "noted: “{text}”",
    "page_released": "released page {page}{because}",
    "page_restarted": "let page {page} begin anew{because}",
    "link_made": "made a new personal link",
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
    "sessions_revoked": "ended {ended} session(s) of {account}",
    "revealed": "revealed the results",
}
_WHY = {
    "expired": "no sign of life within the lease",
    "withdrawn": "they left",
    "screened_out": "they were screened out",
    "erased": "they were erased",
}
_GONE = "…"
"""What stands for something that was erased."""


def sentence(action: Action, page: int | None, part: int | None, detail: Mapping[str, Any]) -> str:
    """Return what happened, without who did it. What was drawn for a participant is never among it."""
    told: dict[str, object] = {name: detail.get(name, _GONE) for name in _TOLD}
    told["why"] = _WHY.get(str(detail.get("why")), _GONE)
    told["page"], told["part"] = page, part
    told["on_page"] = "" if page is None else f" on page {page}"
    told["because"] = f": “{detail['reason']}”" if "reason" in detail else ""
    return _WORDS[action].format_map(told)


_TOLD = ("question", "from", "to", "text", "file", "account", "role", "ended")
