"""Signing in and out."""

import logging
import secrets
from typing import cast

from flask import Response, g, redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue

from webapp.storage.researchers import TooManyAttemptsError
from webapp.storage.researchers import sign_in as open_session
from webapp.storage.researchers import sign_out as close_session
from webapp.views.forms import FormError
from webapp.views.researcher.door import bp, in_words, researcher
from webapp.views.security import cookie_name, delete_cookie, set_cookie
from webapp.views.services import services
from webapp.views.tokens import browser_mark, same

BROWSER_DAYS = 90
"""How long a browser is known from which somebody signed in."""

_LOGGER = logging.getLogger(__name__)


@bp.get("/sign-in")
def sign_in() -> ResponseReturnValue:
    """Ask for name and password."""
    if g.researcher is not None:
        return redirect(url_for(".overview"), code=303)
    return render_template("researcher/sign_in.html", errors=[], name="")


@bp.post("/sign-in")
def check_sign_in() -> ResponseReturnValue:
    """Open a session for whoever knows the password."""
    here = services()
    name, password = request.form.get("name", "").strip(), request.form.get("password", "")
    browser = _known_browser(name)
    try:
        token = open_session(here.database, name, password, here.clock(), browser)
    except TooManyAttemptsError as error:
        _LOGGER.warning("a sign-in was not looked at: the next one is in %d s", error.wait_s)
        message = f"There were too many attempts. Try again in {in_words(error.wait_s)}."
        return _refuse(name, message), 429, {"Retry-After": str(error.wait_s)}
    if token is None:
        _LOGGER.warning("a sign-in failed")
        return _refuse(name, "The name or the password is not right."), 422
    response = redirect(url_for(".overview"), code=303)
    set_cookie(cast("Response", response), here.config, "researcher", token, same_site="Strict", days=None)
    _remember_browser(cast("Response", response), name, browser or secrets.token_hex(16))
    return response


@bp.post("/sign-out")
def sign_out() -> ResponseReturnValue:
    """End the session here and on the server."""
    here = services()
    close_session(here.database, researcher(), here.clock())
    response = redirect(url_for(".sign_in"), code=303)
    delete_cookie(cast("Response", response), here.config, "researcher")
    return response


def _known_browser(name: str) -> str | None:
    """Return the id of this browser if an account of this name has signed in from it before."""
    here = services()
    browser, _, mark = request.cookies.get(cookie_name(here.config, "browser"), "").partition(".")
    return browser if browser and same(mark, browser_mark(here.secret, name, browser)) else None


def _remember_browser(response: Response, name: str, browser: str) -> None:
    """Let guesses from elsewhere keep nobody out who comes back with this browser; the cookie opens nothing."""
    here = services()
    mark = f"{browser}.{browser_mark(here.secret, name, browser)}"
    set_cookie(response, here.config, "browser", mark, same_site="Strict", days=BROWSER_DAYS)


def _refuse(name: str, message: str) -> str:
    return render_template("researcher/sign_in.html", errors=[FormError("name", message)], name=name)
