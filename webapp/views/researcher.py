"""The dashboard: signing in and out, live numbers, results once they are revealed, downloads."""

import tempfile
from dataclasses import asdict
from datetime import datetime
from typing import IO, cast

from flask import Blueprint, Response, abort, g, jsonify, redirect, render_template, request, send_file, url_for
from flask.typing import ResponseReturnValue

from webapp.storage.exports import FILE_NAMES, RECRUITS, FileName, RecruitsName, write_csv
from webapp.storage.overview import Overview, read_overview
from webapp.storage.researchers import (
    ResearcherSession,
    TooManyAttemptsError,
    find_session,
    log_download,
    reveal_ratings,
)
from webapp.storage.researchers import sign_in as open_session
from webapp.storage.researchers import sign_out as close_session
from webapp.views.forms import FormError
from webapp.views.security import cookie_name, delete_cookie, set_cookie
from webapp.views.services import services

bp = Blueprint("researcher", __name__, url_prefix="/researcher")

_OPEN = {"researcher.sign_in", "researcher.check_sign_in"}
_POLLED = "researcher.status"


@bp.before_request
def load_researcher() -> ResponseReturnValue | None:
    """Let nobody in who is not signed in; a new view of this blueprint is closed from the beginning."""
    here = services()
    g.language = "en"  # The dashboard is English, whatever participants read; so is the frame around it if it can be.
    token = request.cookies.get(cookie_name(here.config, "researcher"))
    active = request.endpoint != _POLLED
    g.researcher = None if token is None else find_session(here.database, token, here.clock(), active=active)
    if g.researcher is not None or request.endpoint in _OPEN:
        return None
    if request.endpoint == _POLLED:
        return jsonify(error="signed out"), 401
    return redirect(url_for(".sign_in"), code=303)


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
    try:
        token = open_session(here.database, name, password, here.clock())
    except TooManyAttemptsError as error:
        message = f"There were too many attempts. Try again in {_duration(error.wait_s)}."
        return _refuse(name, message), 429, {"Retry-After": str(error.wait_s)}
    if token is None:
        return _refuse(name, "The name or the password is not right."), 422
    response = redirect(url_for(".overview"), code=303)
    set_cookie(cast("Response", response), here.config, "researcher", token, same_site="Strict", days=None)
    return response


@bp.post("/sign-out")
def sign_out() -> ResponseReturnValue:
    """End the session here and on the server."""
    here = services()
    close_session(here.database, _researcher(), here.clock())
    response = redirect(url_for(".sign_in"), code=303)
    delete_cookie(cast("Response", response), here.config, "researcher")
    return response


@bp.get("/")
def overview() -> ResponseReturnValue:
    """Show the numbers."""
    revealed = _researcher().revealed_at is not None
    return render_template("researcher/overview.html", overview=_overview(revealed=revealed))


@bp.get("/status.json")
def status() -> ResponseReturnValue:
    """Send the live numbers to the open dashboard; results are not among them."""
    numbers = asdict(_overview(revealed=False))
    for participant in numbers["participants"]:
        participant |= {name: _iso(participant[name]) for name in ("consented_at", "last_seen")}
    return jsonify({name: numbers[name] for name in ("counts", "cells", "participants", "num_elsewhere")})


@bp.post("/reveal")
def reveal() -> ResponseReturnValue:
    """Show ratings, predictions and drives for the rest of the session; who asked and when is logged."""
    here = services()
    current = here.bundles.current
    detail = f"{current.study.name} {current.version} {here.config.mode}"
    reveal_ratings(here.database, _researcher(), detail, here.clock())
    return redirect(url_for(".overview"), code=303)


@bp.get("/<name>.csv")
def download(name: str) -> ResponseReturnValue:
    """Download a file of the data."""
    file = next((known for known in FILE_NAMES if known == f"{name}.csv"), None)
    if file is None:
        abort(404)
    return _download(file)


@bp.get("/recruits.csv")
def download_recruits() -> ResponseReturnValue:
    """Download who came from where, if the study has participants sent by a recruiter."""
    if services().bundles.current.study.recruitment is None:
        abort(404)
    return _download(RECRUITS)


def _researcher() -> ResearcherSession:
    researcher = g.researcher
    assert isinstance(researcher, ResearcherSession)  # noqa: S101 - for the type checker: `load_researcher` saw to it
    return researcher


def _overview(*, revealed: bool) -> Overview:
    here = services()
    current = here.bundles.current
    return read_overview(here.database, current.study, current.version, here.config.mode, revealed=revealed)


def _download(name: FileName | RecruitsName) -> Response:
    """Send a file of the data.

    It is written to a nameless file first and sent from there: a slow connection must not keep the database open,
    which would keep participants' answers waiting.
    """
    here = services()
    file = cast("IO[bytes]", tempfile.TemporaryFile(dir=here.config.instance))  # noqa: SIM115 - closed with the response
    with here.database.read() as connection:
        write_csv(connection, name, file)
    file.seek(0)
    log_download(here.database, _researcher(), name, here.clock())
    return send_file(file, mimetype="text/csv", as_attachment=True, download_name=name)


def _refuse(name: str, message: str) -> str:
    return render_template("researcher/sign_in.html", errors=[FormError("name", message)], name=name)


def _duration(seconds: int) -> str:
    if seconds == 1:
        return "1 second"
    return f"{seconds} seconds" if seconds <= 90 else f"{round(seconds / 60)} minutes"  # noqa: PLR2004 - for people


def _iso(time: datetime) -> str:
    return time.isoformat(timespec="seconds").replace("+00:00", "Z")
