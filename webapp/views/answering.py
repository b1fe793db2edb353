"""What every view answers with: another page, the same page again, or its address for a script."""

from collections.abc import Sequence

from flask import Response, get_flashed_messages, jsonify, redirect, request

from webapp.views.texts import texts

NOTICES = {
    "already_answered": "notices.already_answered",
    "too_early": "notices.too_early",
    "stale": "notices.stale",
    "quiz_failed": "notices.quiz_failed",
    "drive_reached": "notices.drive_reached",
    "drive_gave_up": "notices.drive_gave_up",
    "drive_step_limit": "notices.drive_step_limit",
    "drive_failed": "notices.drive_failed",
    "practice_over": "notices.practice_over",
    "language_unknown": "notices.language_unknown",
}
"""What a page may say above everything else, once, after something happened; the key of the text."""


def wants_json() -> bool:
    """Tell whether a script of ours asks, which goes to the next page by itself."""
    wanted = request.headers.get("Accept", "")
    return "json" in wanted and request.accept_mimetypes.best == "application/json"


def go_to(address: str) -> Response:
    """Send a browser to another page, or tell a script where that is."""
    if wants_json():
        return jsonify(next=address)
    response = redirect(address, code=303)
    assert isinstance(response, Response)  # noqa: S101 - for the type checker: Flask's redirect makes Flask's response
    return response


def notice() -> str | None:
    """Return what is to be said about what happened last, or None; asking for it uses it up."""
    keys: Sequence[object] = get_flashed_messages()
    return texts()(NOTICES[str(keys[-1])]) if keys else None
