"""The pages of the study, from the first after the consent to the thanks."""

from flask import Blueprint, Response, abort, flash, render_template, request, url_for

from webapp.storage.answers import store_page
from webapp.storage.enrolment import find_recruit
from webapp.storage.participants import Participant, withdraw
from webapp.study.recruitment import Ending, way_back
from webapp.study.sections import ReturnPath
from webapp.study.session import DRIVEN
from webapp.views.answering import go_to, notice
from webapp.views.forms import refusal_of
from webapp.views.pages import Problems, attempt_at, parse_page, render_page
from webapp.views.services import services
from webapp.views.texts import catalogue
from webapp.views.visit import load_participant, load_visit, place_after, place_of

bp = Blueprint("participant", __name__)

PICTURE_CACHE_CONTROL = f"public, max-age={365 * 24 * 3600}, immutable"


@bp.get("/study")
def study() -> Response:
    """Go to the page that the participant is at."""
    return go_to(place_of(load_participant()))


@bp.get("/study/<int:number>")
def show_page(number: int) -> str | Response:
    """Show a page if the participant is at it, else go to where the participant is."""
    visit = load_visit()
    page = visit.page(number)
    here = place_of(visit.participant)
    if here != url_for(".show_page", number=number):
        if visit.participant.is_in_progress:
            flash("already_answered" if number <= visit.participant.num_stored else "too_early")
        return go_to(here)
    return render_page(visit, page)


@bp.post("/study/<int:number>")
def submit_page(number: int) -> Response | tuple[str, int]:
    """Store a page whole and go on; a page that is not due changes nothing, and its sender is told so."""
    visit = load_visit()
    page = visit.page(number)
    refusal = refusal_of(request.form, visit, page, attempt_at(visit, page))
    if refusal is None and page.kind in DRIVEN:
        refusal = "stale"  # A drive ends with an action, which has an address of its own.
    if refusal is not None:
        if not visit.participant.was_ended_early:
            flash(refusal)
        return go_to(place_of(visit.participant))
    content = parse_page(visit, page, request.form)
    if isinstance(content, Problems):
        return render_page(visit, page, request.form, content), 422
    here = services()
    outcome = store_page(here.database, visit.participant, page, request.form["nonce"], content, here.clock())
    if outcome != "accept":
        if outcome != "ended":
            flash(outcome)
        return go_to(place_of(load_participant()))
    if content.failed and not content.screens_out:
        flash("quiz_failed")
    return go_to(place_after(visit.participant, page, content))


@bp.get("/leave")
def leave() -> str | Response:
    """Ask whether the participant wants to leave for good."""
    participant = load_participant()
    if not participant.is_in_progress:
        return go_to(place_of(participant))
    return render_template("participant/leave.html")


@bp.post("/leave")
def confirm_leave() -> Response:
    """Note that the participant left."""
    here = services()
    withdraw(here.database, load_participant(), here.clock())
    return go_to(url_for(".study"))


@bp.get("/left")
def left() -> str | Response:
    """Take leave of somebody who left."""
    participant = load_participant()
    if participant.withdrawn_at is None:
        return go_to(place_of(participant))
    return render_template("participant/left.html", back=_back(participant, "withdrawn"))


@bp.get("/ended")
def ended() -> str | Response:
    """Take leave of somebody whom the quiz ended the study for."""
    participant = load_participant()
    if participant.screened_out_at is None:
        return go_to(place_of(participant))
    return render_template("participant/ended.html", back=_back(participant, "screened_out"))


@bp.get("/done")
def done() -> str | Response:
    """Thank somebody whose last page is stored; only then is there a completion code."""
    participant = load_participant()
    if participant.completed_at is None or participant.withdrawn_at is not None:
        return go_to(place_of(participant))
    return render_template("participant/done.html", notice=notice(), back=_back(participant, "completed"))


@bp.get("/pictures/<digest>.png")
def picture(digest: str) -> Response:
    """Send a picture; its name says what it shows, so it may be kept for ever. One that was changed is not sent."""
    found = services().bundles.picture(digest)
    if found is None:
        abort(404)
    response = Response(found.content, mimetype="image/png", headers={"Cache-Control": PICTURE_CACHE_CONTROL})
    response.set_etag(digest)
    response.last_modified = found.changed_at
    response.make_conditional(request.environ, accept_ranges=True, complete_length=len(found.content))
    return response


def _back(participant: Participant, ending: Ending) -> ReturnPath | None:
    recruitment = catalogue().study.recruitment
    if recruitment is None:
        return None
    return way_back(recruitment, ending, find_recruit(services().database, participant))
