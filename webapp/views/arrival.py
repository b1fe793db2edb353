"""Before the study: where somebody comes from, which language they read, what they agree to; and the way back in."""

import secrets
from collections.abc import Mapping, Sequence

from flask import Blueprint, Response, flash, render_template, request, session, url_for

from webapp.storage.enrolment import Enrolment, StudyFullError, enrol
from webapp.storage.participants import Participant, hash_token
from webapp.storage.scope import Mode
from webapp.study.recruitment import PARAMETERS, Recruit, RecruitmentError, parse_recruit, way_back
from webapp.views.answering import go_to, notice
from webapp.views.forms import FormError, consent_nonce
from webapp.views.security import cookie_name, delete_cookie, set_cookie
from webapp.views.services import services
from webapp.views.texts import choose_language, language, texts
from webapp.views.tokens import bot_pass, participant_token, recruit_token, same
from webapp.views.visit import (
    NoPlaceError,
    find_by_token,
    find_current_participant,
    load_participant,
    place_of,
    speak_as_before,
)

bp = Blueprint("arrival", __name__)

COOKIE_DAYS = 30
"""How long a participant who closed the browser finds the way back."""

_RECRUIT = "recruit"

_WISHES = {
    "PROLIFIC_PID": "wrong_link.prolific",
    "STUDY_ID": "wrong_link.prolific",
    "SESSION_ID": "wrong_link.session",
    "id": "wrong_link.sona",
    "label": "wrong_link.label",
}
"""What each parameter of a recruiter's link should be; the key of the text."""


@bp.get("/")
def welcome() -> str | Response | tuple[str, int]:
    """Tell what the study is about and ask for consent; who has begun goes on.

    What the link says about recruiter and language is taken out of the address at once.
    """
    if request.args:
        return _read_link()
    return _place_or_refusal() or _render_welcome(errors=[])


@bp.post("/consent")
def consent() -> Response | tuple[str, int]:
    """Store the consent, with everything that is drawn for the participant, and begin."""
    elsewhere = _place_or_refusal()
    if elsewhere is not None:
        return elsewhere
    errors = _consent_errors(request.form)
    if errors:
        return _render_welcome(errors), 422
    here, recruit = services(), _recruit()
    current = here.bundles.current
    token = _token(recruit) if recruit else participant_token(here.secret, _nonce_of(request.form))
    enrolment = Enrolment(
        study=current.study,
        study_version=current.version,
        mode=_mode(),
        token_hash=hash_token(token),
        language=language(),
        guardian_agreed=_guardian_agreed(request.form),
        recruit=recruit,
    )
    try:
        return _let_in(enrol(here.database, enrolment, here.clock()), token)
    except StudyFullError:
        return render_template("participant/full.html"), 503


@bp.get("/declined")
def declined() -> str | Response:
    """Thank somebody who does not take part, and of whom nothing was stored; who takes part is asked about leaving."""
    participant = find_current_participant()
    if participant is not None and participant.is_in_progress:
        return go_to(url_for("participant.leave"))
    if participant is not None and _is_theirs(participant):
        return go_to(place_of(participant))
    recruitment = services().bundles.current.study.recruitment
    back = None if recruitment is None else way_back(recruitment, "no_consent", _recruit())
    return render_template("participant/declined.html", back=back)


@bp.get("/another-device")
def another_device() -> str | Response:
    """Show the personal link, which leads to the same place on any device."""
    participant = load_participant()
    if not participant.is_in_progress:
        return go_to(place_of(participant))
    token = request.cookies[cookie_name(services().config, "participant")]
    link = url_for(".resume", token=token, _external=True)
    return render_template("participant/another_device.html", link=link, place=place_of(participant))


@bp.get("/resume/<token>")
def resume(token: str) -> str:
    """Ask whether to go on here; that the link was opened, perhaps by a program, changes nothing."""
    participant = _find_for(token)
    return render_template("participant/resume.html", token=token, is_over=not participant.is_in_progress)


@bp.post("/resume/<token>")
def confirm_resume(token: str) -> Response:
    """Let this browser go on where another one stopped."""
    return _let_in(_find_for(token), token)


def _read_link() -> Response | tuple[str, int]:
    """Remember what a link says, and go on without it in the address."""
    chosen = request.args.get("lang")
    if chosen is not None and not choose_language(chosen):
        flash("language_unknown")
    recruitment = services().bundles.current.study.recruitment
    try:
        recruit = None if recruitment is None else parse_recruit(recruitment, request.args)
    except RecruitmentError as error:
        return _refuse_link(error)
    if recruit is None:
        return go_to(url_for(".welcome"))
    token = _token(recruit)
    known = find_by_token(token)
    if known is not None:
        return _let_in(known, token)
    session[_RECRUIT] = [recruit.service, recruit.external_id, recruit.external_study, recruit.external_session]
    response = go_to(url_for(".welcome"))
    # Whoever used this browser before is somebody else, and has a link of their own.
    delete_cookie(response, services().config, "participant")
    return response


def _place_or_refusal() -> Response | tuple[str, int] | None:
    """Say where somebody belongs who need not be asked for consent, or why nobody can be; None for newcomers."""
    participant = find_current_participant()
    if participant is not None and (participant.is_in_progress or _is_theirs(participant)):
        return go_to(place_of(participant))
    missing = _missing_parameter()
    return None if missing is None else _refuse_link(missing)


def _is_theirs(participant: Participant) -> bool:
    """Tell whether the study is over for whoever asks, rather than for somebody who used this browser before.

    Where recruiters send people, a newcomer comes by a link.
    """
    recruitment = services().bundles.current.study.recruitment
    return recruitment is not None and not participant.is_in_progress and _recruit() is None


def _missing_parameter() -> RecruitmentError | None:
    """Say what somebody lacks who came to a live study without the recruiter's link and could not be paid."""
    recruitment = services().bundles.current.study.recruitment
    if recruitment is None or _mode() != "live" or _recruit() is not None:
        return None
    return RecruitmentError(PARAMETERS[recruitment.service][0].name, "", "given")


def _refuse_link(error: RecruitmentError) -> tuple[str, int]:
    shown = {"name": error.name, "value": error.value, "wish": texts()(_WISHES[error.name])}
    return render_template("participant/wrong_link.html", **shown), 400


def _let_in(participant: Participant, token: str) -> Response:
    session.pop(_RECRUIT, None)
    response = go_to(place_of(participant))
    set_cookie(response, services().config, "participant", token, same_site="Lax", days=COOKIE_DAYS)
    return response


def _recruit() -> Recruit | None:
    """Return whom the recruiter's link was for that this browser came by, if it did."""
    recruitment = services().bundles.current.study.recruitment
    kept = session.get(_RECRUIT)
    if recruitment is None or kept is None or kept[0] != recruitment.service:
        return None
    return Recruit(*kept)


def _token(recruit: Recruit) -> str:
    here = services()
    session_id = recruit.external_session or ""
    return recruit_token(
        here.secret, here.config.mode, here.config.study, recruit.service, recruit.external_id, session_id
    )


def _find_for(token: str) -> Participant:
    participant = find_by_token(token)
    if participant is None:
        raise NoPlaceError("no participant belongs to this link")
    speak_as_before(participant)
    return participant


def _mode() -> Mode:
    """Return as what somebody takes part: a program of ours shows a pass, and says so."""
    here = services()
    is_bot = same(request.headers.get("Xar-Bot", ""), bot_pass(here.secret))
    return "bot" if is_bot else here.config.mode


def _nonce_of(form: Mapping[str, str]) -> str:
    return consent_nonce(form) or secrets.token_hex(16)


def _guardian_agreed(form: Mapping[str, str]) -> bool | None:
    if services().bundles.current.study.consent.guardian_below is None:
        return None
    return form.get("age_group") == "guardian"


def _consent_errors(form: Mapping[str, str]) -> list[FormError]:
    errors, t = [], texts()
    asks_for_age = services().bundles.current.study.consent.guardian_below is not None
    if asks_for_age and form.get("age_group") not in {"adult", "guardian"}:
        errors.append(FormError("age-group-adult", t("errors.age_group")))
    if form.get("agree") != "yes":
        errors.append(FormError("agree", t("errors.agree")))
    return errors


def _render_welcome(errors: Sequence[FormError]) -> str:
    return render_template(
        "participant/welcome.html",
        errors=errors,
        nonce=secrets.token_hex(16),
        notice=notice(),
        age_group=request.form.get("age_group", ""),
        agrees=request.form.get("agree") == "yes",
    )
