"""Who gets into the dashboard, and how far: all look on, owners change things, and admins manage accounts too."""

import functools
import logging
from collections.abc import Callable
from typing import ParamSpec

from flask import Blueprint, g, jsonify, redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue

from webapp.storage.researchers import ResearcherSession, Role, TooManyAttemptsError, find_session, knows_password
from webapp.views.security import cookie_name
from webapp.views.services import services

bp = Blueprint("researcher", __name__, url_prefix="/researcher")

POLLED = frozenset({"researcher.status", "researcher.people_status"})
"""What an open page asks for by itself; it keeps no session alive."""

POLL_HEADER = "X-Poll"
"""What an open page sends when it fetches itself anew, which nobody asked for either."""

_OPEN = frozenset({"researcher.sign_in", "researcher.check_sign_in"})
_LONG_WAIT_S = 90
_LOGGER = logging.getLogger(__name__)
_Given = ParamSpec("_Given")


class NotConfirmedError(ValueError):
    """Something that needs the password again, without the right one; the message says so."""


@bp.before_request
def load_researcher() -> ResponseReturnValue | None:
    """Let nobody in who is not signed in; a new view of this blueprint is closed from the beginning."""
    here = services()
    g.language = "en"  # The dashboard is English, whatever participants read; so is the frame around it if it can be.
    token = request.cookies.get(cookie_name(here.config, "researcher"))
    active = request.endpoint not in POLLED and POLL_HEADER not in request.headers
    g.researcher = None if token is None else find_session(here.database, token, here.clock(), active=active)
    if g.researcher is not None or request.endpoint in _OPEN:
        return None
    if request.endpoint in POLLED:
        return jsonify(error="signed out"), 401
    return redirect(url_for(".sign_in"), code=303)


def researcher() -> ResearcherSession:
    """Return who is signed in."""
    found = g.researcher
    assert isinstance(found, ResearcherSession)  # noqa: S101 - for the type checker: `load_researcher` saw to it
    return found


def requires(
    role: Role,
) -> Callable[[Callable[_Given, ResponseReturnValue]], Callable[_Given, ResponseReturnValue]]:
    """Let a view be for those who may do what a role may; the others are told which role is needed."""

    def decorate(view: Callable[_Given, ResponseReturnValue]) -> Callable[_Given, ResponseReturnValue]:
        @functools.wraps(view)
        def checked(*args: _Given.args, **kwargs: _Given.kwargs) -> ResponseReturnValue:
            if researcher().may(role):
                return view(*args, **kwargs)
            _LOGGER.warning("%s %s refused: it needs %s", request.method, request.url_rule, role)
            return render_template("researcher/forbidden.html", needed=role), 403

        return checked

    return decorate


def confirm_password() -> None:
    """Make sure that the form holds the password of whoever is signed in.

    Raises:
        NotConfirmedError: It does not, or wrong ones came too fast.
    """
    here = services()
    try:
        is_right = knows_password(here.database, researcher(), request.form.get("password", ""), here.clock())
    except TooManyAttemptsError as error:
        raise NotConfirmedError(f"there were too many attempts; try again in {in_words(error.wait_s)}") from error
    if not is_right:
        raise NotConfirmedError("the password is not right")


def in_words(seconds: int) -> str:
    """Return how long to wait."""
    if seconds == 1:
        return "1 second"
    return f"{seconds} seconds" if seconds <= _LONG_WAIT_S else f"{round(seconds / 60)} minutes"
