"""The pages that participants see, from the welcome to the thanks."""

import secrets
from collections.abc import Mapping, Sequence
from typing import Any

from flask import (
    Blueprint,
    Response,
    abort,
    flash,
    get_flashed_messages,
    redirect,
    render_template,
    request,
    send_file,
    url_for,
)

from webapp.storage.participants import Enrolment, enrol, find_participant, hash_token, store_page, withdraw
from webapp.study.questionnaire import RatingProblem, parse_ratings
from webapp.study.session import Page
from webapp.views.forms import FormError, agrees, consent_nonce, rating_errors, rating_fields, refusal_of
from webapp.views.security import set_cookie
from webapp.views.services import services
from webapp.views.texts import texts
from webapp.views.tokens import participant_token
from webapp.views.visit import Visit, find_current_participant, is_in_progress, load_participant, load_visit, place_of

bp = Blueprint("participant", __name__)

COOKIE_DAYS = 7
"""How long a participant who closed the browser finds the way back."""

_NOTICES = {
    "already_answered": "notices.already_answered",
    "too_early": "notices.too_early",
    "stale": "notices.stale",
}

PICTURE_MAX_AGE_S = 365 * 24 * 3600


@bp.get("/")
def welcome() -> str | Response:
    """Tell what the study is about and ask for consent; who has begun goes on."""
    participant = find_current_participant()
    if participant is not None and is_in_progress(participant):
        return _redirect(place_of(participant))
    return _render_welcome(errors=[])


@bp.post("/consent")
def consent() -> Response | tuple[str, int]:
    """Store the consent, with everything that is drawn for the participant, and begin."""
    if not agrees(request.form):
        return _render_welcome(errors=[FormError("agree", texts()("errors.agree"))]), 422
    participant = find_current_participant()
    if participant is not None and is_in_progress(participant):
        return _redirect(place_of(participant))
    here = services()
    token = participant_token(here.secret, consent_nonce(request.form) or secrets.token_hex(16))
    current = here.bundles.current
    enrolment = Enrolment(current.study, current.version, here.config.mode, hash_token(token))
    response = _redirect(place_of(enrol(here.database, enrolment, here.clock())))
    set_cookie(response, here.config, "participant", token, same_site="Lax", days=COOKIE_DAYS)
    return response


@bp.get("/declined")
def declined() -> str:
    """Thank somebody who does not take part; nothing was stored."""
    return render_template("participant/declined.html")


@bp.get("/study")
def study() -> Response:
    """Go to the page that the participant is at."""
    return _redirect(place_of(load_participant()))


@bp.get("/study/<int:number>")
def show_page(number: int) -> str | Response:
    """Show a page if the participant is at it, else go to where the participant is."""
    visit = load_visit()
    page = visit.page(number)
    here = place_of(visit.participant)
    if here != url_for(".show_page", number=number):
        if is_in_progress(visit.participant):
            flash("already_answered" if number <= visit.participant.num_stored else "too_early")
        return _redirect(here)
    return _render_page(visit, page)


@bp.post("/study/<int:number>")
def submit_page(number: int) -> Response | tuple[str, int]:
    """Store a page whole and go on; a page that is not due changes nothing, and its sender is told so."""
    visit = load_visit()
    page = visit.page(number)
    refusal = refusal_of(request.form, visit, page)
    if refusal is not None:
        if visit.participant.withdrawn_at is None:
            flash(refusal)
        return _redirect(place_of(visit.participant))
    answers = parse_ratings(request.form, _items(visit, page)) if page.kind == "rating" else None
    if isinstance(answers, tuple):
        return _render_page(visit, page, request.form, answers), 422
    here = services()
    outcome = store_page(here.database, visit.participant, page, visit.nonce(page), answers, here.clock())
    if outcome == "already_answered":
        flash(outcome)
    participant = find_participant(here.database, visit.participant.token_hash)
    assert participant is not None  # noqa: S101 - for the type checker: it was there a moment ago
    return _redirect(place_of(participant))


@bp.get("/leave")
def leave() -> str | Response:
    """Ask whether the participant wants to leave for good."""
    participant = load_participant()
    if not is_in_progress(participant):
        return _redirect(place_of(participant))
    return render_template("participant/leave.html")


@bp.post("/leave")
def confirm_leave() -> Response:
    """Note that the participant left."""
    here = services()
    participant = load_participant()
    withdraw(here.database, participant, here.clock())
    return _redirect(url_for(".study"))


@bp.get("/left")
def left() -> str | Response:
    """Take leave of somebody who left."""
    participant = load_participant()
    if participant.withdrawn_at is None:
        return _redirect(place_of(participant))
    return render_template("participant/left.html")


@bp.get("/done")
def done() -> str | Response:
    """Thank somebody whose last page is stored."""
    participant = load_participant()
    if participant.completed_at is None or participant.withdrawn_at is not None:
        return _redirect(place_of(participant))
    return render_template("participant/done.html", notice=_notice())


@bp.get("/pictures/<digest>.png")
def picture(digest: str) -> Response:
    """Send a picture; its name says what it shows, so it may be kept for ever."""
    path = services().bundles.picture_path(digest)
    if path is None:
        abort(404)
    response = send_file(path, mimetype="image/png", max_age=PICTURE_MAX_AGE_S, etag=digest)
    response.cache_control.public = True
    response.cache_control.immutable = True
    return response


def _render_welcome(errors: Sequence[FormError]) -> str:
    return render_template("participant/welcome.html", errors=errors, nonce=secrets.token_hex(16))


def _render_page(
    visit: Visit, page: Page, form: Mapping[str, str] | None = None, problems: Sequence[RatingProblem] = ()
) -> str:
    notice = _notice()
    facts = {"number": page.number, "num_pages": len(visit.pages), "nonce": visit.nonce(page), "notice": notice}
    shown = _explanation(visit, page, form or {}, problems) if page.kind == "rating" else _situation(visit, page)
    return render_template(f"participant/{page.kind}.html", page=facts, notice=notice, trial=page.trial, **shown)


def _situation(visit: Visit, page: Page) -> dict[str, Any]:
    return {} if page.trial is None else {"situation": visit.catalogue.situation(page.trial, visit.language)}


def _explanation(
    visit: Visit, page: Page, form: Mapping[str, str], problems: Sequence[RatingProblem]
) -> dict[str, Any]:
    assert page.trial is not None  # noqa: S101 - for the type checker: every rating page has a trial
    t = texts()
    fields = rating_fields(form, _items(visit, page), problems, page.trial.experiment, t)
    strips = visit.catalogue.explanation(page.trial, visit.language)
    return {"strips": strips, "items": fields, "errors": rating_errors(fields)}


def _items(visit: Visit, page: Page) -> Sequence[Any]:
    assert page.trial is not None  # noqa: S101 - for the type checker: every rating page has a trial
    return visit.catalogue.study.experiment(page.trial.experiment).items


def _notice() -> str | None:
    keys = get_flashed_messages()
    return texts()(_NOTICES[str(keys[-1])]) if keys else None


def _redirect(address: str) -> Response:
    response = redirect(address, code=303)
    assert isinstance(response, Response)  # noqa: S101 - for the type checker: Flask's redirect makes Flask's response
    return response
