"""What owners may do about one participant. Each is recorded with who, when and why; a form in error loses nothing."""

from collections.abc import Callable

from flask import redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue

from webapp.storage import helping, people
from webapp.storage.erasure import erase
from webapp.storage.participants import find_trials
from webapp.storage.people import Correction, PersonError
from webapp.storage.unblinding import unblind_person
from webapp.study.session import pages
from webapp.views.researcher.door import NotConfirmedError, bp, confirm_password, requires, researcher
from webapp.views.researcher.frame import look_at_person
from webapp.views.researcher.person_page import find_or_404, show_person
from webapp.views.services import services


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
        "exclude",
        "included",
        lambda: people.include(here.database, code, _said("reason"), researcher().name, here.clock()),
    )


@bp.post("/people/<code>/correct")
@requires("owner")
def correct_person(code: str) -> ResponseReturnValue:
    """Record what should stand in the data."""
    here = services()

    def correct() -> None:
        correction = _correction()
        people.correct(here.database, code, correction, _said("reason"), researcher().name, here.clock())

    return _do(code, "correct", "corrected", correct)


@bp.post("/people/<code>/release")
@requires("owner")
def release_page(code: str) -> ResponseReturnValue:
    """Let somebody go on without the page they are at."""
    here, person = services(), find_or_404(code)
    all_pages = pages(look_at_person(person).study, find_trials(here.database, person))
    number = _page_number()

    def release() -> None:
        if not 1 <= number <= len(all_pages):
            raise PersonError(f"there is no page {number}")
        page = all_pages[number - 1]
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
            here.database, code, _page_number(), _said("reason"), researcher().name, here.clock()
        ),
    )


@bp.post("/people/<code>/link")
@requires("owner")
def make_link(code: str) -> ResponseReturnValue:
    """Make a new personal link and show it this once; it stands nowhere else."""
    here = services()
    find_or_404(code)
    try:
        token = helping.make_link(here.database, code, researcher().name, here.clock())
    except PersonError as error:
        return show_person(code, ("link", str(error))), 422
    return show_person(code, link=url_for("arrival.resume", token=token, _external=True))


@bp.post("/people/<code>/look")
@requires("owner")
def look_at_pictures(code: str) -> ResponseReturnValue:
    """Show this account what one participant saw."""
    here, person = services(), find_or_404(code)
    return _do(
        code,
        "look",
        "person_unblinded",
        lambda: unblind_person(here.database, researcher().name, person, _said("reason"), here.clock()),
    )


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
        erase(here.database, code, researcher().name, here.clock())
    except (NotConfirmedError, PersonError) as error:
        return _erase_page(code, str(error)), 422
    return redirect(url_for(".people", done="erased"), code=303)


def _do(code: str, form: str, done: str, action: Callable[[], None]) -> ResponseReturnValue:
    """Do something about a participant, then show their page; if it cannot be done, with the form as it was."""
    person = find_or_404(code)
    look_at_person(person)
    try:
        action()
    except PersonError as error:
        return show_person(code, (form, str(error))), 422
    return redirect(url_for(".person", code=code, done=done), code=303)


def _said(name: str) -> str:
    return request.form.get(name, "")


def _confirm_code(code: str) -> None:
    if _said("code").strip() != code:
        raise PersonError(f"type the code {code} to say that you mean this person")


def _page_number() -> int:
    said = _said("page")
    return int(said) if said.isdecimal() and len(said) < 6 else 0  # noqa: PLR2004 - more digits than any page has


def _correction() -> Correction:
    file, _, place = _said("place").partition("|")
    page, _, question = place.partition("|")
    if not (page.isdecimal() and question):
        raise PersonError("choose the value that is to be corrected")
    return Correction(file, int(page), question, _said("value"))


def _erase_page(code: str, problem: str | None = None) -> str:
    person = find_or_404(code)
    look_at_person(person)
    return render_template("researcher/erase.html", person=person, problem=problem, typed=_said("code"))
