"""What owners may do about one participant. Each is recorded with who, when and why; a form in error loses nothing."""

import re
from collections.abc import Callable

from flask import redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue

from webapp.storage import helping, people
from webapp.storage.erasure import erase
from webapp.storage.participants import Participant, find_trials
from webapp.storage.people import Correction, PersonError
from webapp.storage.unblinding import unblind_person
from webapp.study.corrections import Asked
from webapp.study.session import Page, pages
from webapp.views.researcher.door import NotConfirmedError, bp, confirm_password, requires, researcher
from webapp.views.researcher.frame import look, look_at_person
from webapp.views.researcher.person_page import find_or_404, sees_pictures, show_person
from webapp.views.services import services

_MAX_QUOTED = 12
"""How much of what is no number of a page is said again."""


@bp.post("/people/<code>/note")
@requires("owner")
def note_person(code: str) -> ResponseReturnValue:
    """Keep a note."""
    here = services()
    return _do(
        code, "note", "noted", lambda: people.note(here.database, code, _said("text"), researcher().name, here.clock())
    )


@bp.post("/people/<code>/exclude")
@requires("owner")
def exclude_person(code: str) -> ResponseReturnValue:
    """Exclude somebody from the analysis."""
    here = services()
    return _do(
        code,
        "exclude",
        "excluded",
        lambda: people.exclude(here.database, code, _said("reason"), researcher().name, here.clock()),
    )


@bp.post("/people/<code>/include")
@requires("owner")
def include_person(code: str) -> ResponseReturnValue:
    """Take an exclusion back."""
    here = services()
    return _do(
        code,
        "include",
        "included",
        lambda: people.include(here.database, code, _said("reason"), researcher().name, here.clock()),
    )


@bp.post("/people/<code>/correct")
@requires("owner")
def correct_person(code: str) -> ResponseReturnValue:
    """Record what should stand in the data."""
    here, person = services(), find_or_404(code)
    look_at_person(person)

    def correct() -> None:
        correction = _correction(person)
        people.correct(here.database, code, correction, _said("reason"), researcher().name, here.clock())

    return _do(code, "correct", "corrected", correct)


@bp.post("/people/<code>/release")
@requires("owner")
def release_page(code: str) -> ResponseReturnValue:
    """Let somebody go on without the page they are at."""
    here, person = services(), find_or_404(code)
    look_at_person(person)

    def release() -> None:
        page = _page_of(person, _said("page"))
        helping.release_page(here.database, code, page, _said("reason"), researcher().name, here.clock())

    return _do(code, "help", "released", release)


@bp.post("/people/<code>/restart")
@requires("owner")
def restart_page(code: str) -> ResponseReturnValue:
    """Let the page that somebody is at begin anew."""
    here = services()
    return _do(
        code,
        "help",
        "restarted",
        lambda: helping.restart_page(
            here.database, code, _number(_said("page")), _said("reason"), researcher().name, here.clock()
        ),
    )


@bp.post("/people/<code>/link")
@requires("owner")
def make_link(code: str) -> ResponseReturnValue:
    """Make a new personal link and show it this once; it stands nowhere else."""
    here = services()
    find_or_404(code)
    try:
        token = helping.make_link(here.database, code, _said("reason"), researcher().name, here.clock())
    except PersonError as error:
        return show_person(code, ("link", str(error))), 422
    return show_person(code, link=url_for("arrival.resume", token=token, _external=True))


@bp.post("/people/<code>/look")
@requires("owner")
def look_at_pictures(code: str) -> ResponseReturnValue:
    """Show this account what one participant saw, and from then on nothing by arm while the arms are masked."""
    here, person = services(), find_or_404(code)

    def unblind() -> None:
        confirm_password()
        unblind_person(here.database, researcher().name, person, _said("reason"), here.clock())

    return _do(code, "look", "person_unblinded", unblind)


@bp.get("/people/<code>/erase")
@requires("owner")
def ask_to_erase(code: str) -> ResponseReturnValue:
    """Say what goes and what stays."""
    return _erase_page(code)


@bp.post("/people/<code>/erase")
@requires("owner")
def erase_person(code: str) -> ResponseReturnValue:
    """Withdraw somebody and erase every row of theirs."""
    here = services()
    find_or_404(code)
    try:
        _confirm_code(code)
        confirm_password()
        is_gone = erase(here.database, code, researcher().name, here.clock())
    except (NotConfirmedError, PersonError) as error:
        return _erase_page(code, str(error)), 422
    return redirect(url_for(".people", done="erased" if is_gone else "erased_for_now"), code=303)


def _do(code: str, form: str, done: str, action: Callable[[], None]) -> ResponseReturnValue:
    """Do something about a participant, then show their page; if it cannot be done, with the form as it was."""
    person = find_or_404(code)
    look_at_person(person)
    try:
        action()
    except (NotConfirmedError, PersonError) as error:
        return show_person(code, (form, str(error))), 422
    return redirect(url_for(".person", code=code, done=done), code=303)


def _said(name: str) -> str:
    return request.form.get(name, "")


def _confirm_code(code: str) -> None:
    if _said("code").strip() != code:
        raise PersonError(f"type the code {code} to say that you mean this person")


def _number(said: str) -> int:
    """Return the number of a page, or 0 for what no page has."""
    return int(said) if re.fullmatch(r"[0-9]{1,5}", said) else 0


def _page_of(person: Participant, said: str) -> Page:
    """Return a page of a participant to whose data `look` has turned.

    Raises:
        PersonError: They have no such page.
    """
    planned = pages(look().study, find_trials(services().database, person))
    number = _number(said)
    if not 1 <= number <= len(planned):
        raise PersonError(f"there is no page {said[:_MAX_QUOTED]}; there are {len(planned)}")
    return planned[number - 1]


def _correction(person: Participant) -> Correction:
    file, _, place = _said("place").partition("|")
    if file and file != "answers" and not sees_pictures(person):
        # Even a refusal would tell: that an item was not asked, or what actions there are.
        raise PersonError("while arms are masked only answers can be corrected; look at what this person saw first")
    number, _, question = place.partition("|")
    if not (number and question):
        raise PersonError("choose the value that is to be corrected")
    page = _page_of(person, number)
    actions = () if page.trial is None else look().catalogue.world(page.trial.layout).actions
    return Correction(file, Asked(look().study, page, actions), question, _said("value"))


def _erase_page(code: str, problem: str | None = None) -> str:
    person = find_or_404(code)
    look_at_person(person)
    return render_template("researcher/erase.html", person=person, problem=problem, typed=_said("code"))
