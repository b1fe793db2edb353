"""Accounts and sessions: everybody sees and ends their own sessions, admins those of all, with roles."""

from flask import g, redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue

from webapp.storage.accounts import AccountError, accounts, change_role, disable, open_sessions, revoke_sessions
from webapp.storage.researchers import ROLES, Role
from webapp.views.researcher.door import bp, requires, researcher
from webapp.views.services import services

ROLE_WORDS = {
    "viewer": "looks on; arms stay masked, nothing can be changed or downloaded",
    "owner": "unblinds, decides about participants, downloads",
    "admin": "what owners may, and accounts",
}

ALL_OTHERS = "all-others"
"""What the form sends, in the place of a session's id, to end all but the browser's own."""


@bp.get("/accounts")
def account_page() -> ResponseReturnValue:
    """Show sessions, and to admins accounts."""
    return _page()


@bp.post("/accounts/sessions")
def end_sessions() -> ResponseReturnValue:
    """End one session of one's own, or all the others if the form says so."""
    here, own = services(), researcher()
    chosen = request.form.get("session", "")
    theirs = [session.id for session in open_sessions(here.database, here.clock(), own.name)]
    if chosen != ALL_OTHERS and chosen not in theirs:
        return _page(f"you have no session {chosen!r}, or it has ended already"), 422
    own_session = _own_session()
    ended = [session for session in theirs if session != own_session] if chosen == ALL_OTHERS else [chosen]
    for session in ended:
        revoke_sessions(here.database, own.name, own.name, here.clock(), session)
    return redirect(url_for(".account_page", done="revoked"), code=303)


@bp.post("/accounts/<name>/sessions")
@requires("admin")
def end_sessions_of(name: str) -> ResponseReturnValue:
    """End the sessions of an account."""
    here = services()
    try:
        revoke_sessions(here.database, name, researcher().name, here.clock())
    except AccountError as error:
        return _page(str(error)), 422
    return redirect(url_for(".account_page", done="revoked"), code=303)


@bp.post("/accounts/<name>/role")
@requires("admin")
def give_role(name: str) -> ResponseReturnValue:
    """Give an account another role."""
    here = services()
    try:
        _refuse_oneself(name)
        change_role(here.database, name, _chosen_role(), researcher().name, here.clock())
    except AccountError as error:
        return _page(str(error)), 422
    return redirect(url_for(".account_page", done="role"), code=303)


@bp.post("/accounts/<name>/close")
@requires("admin")
def close_account(name: str) -> ResponseReturnValue:
    """Close an account for good."""
    here = services()
    try:
        _refuse_oneself(name)
        disable(here.database, name, researcher().name, here.clock())
    except AccountError as error:
        return _page(str(error)), 422
    return redirect(url_for(".account_page", done="disabled"), code=303)


def _chosen_role() -> Role:
    chosen = next((known for known in ROLES if known == request.form.get("role")), None)
    if chosen is None:
        raise AccountError(f"choose a role: {', '.join(ROLES)}")
    return chosen


def _refuse_oneself(name: str) -> None:
    """Keep an admin from locking themselves out."""
    if name == researcher().name:
        raise AccountError("another admin has to change your own account, so that somebody always can")


def _own_session() -> str:
    """Return the id of this browser's session."""
    here, own = services(), researcher()
    ids = [session.id for session in open_sessions(here.database, here.clock(), own.name)]
    return next((one for one in ids if own.token_hash.startswith(one)), "")


def _page(problem: str | None = None) -> str:
    here, own = services(), researcher()
    is_admin = own.may("admin")
    return render_template(
        "researcher/accounts.html",
        own_sessions=open_sessions(here.database, here.clock(), own.name),
        own_session=_own_session(),
        all_others=ALL_OTHERS,
        accounts=accounts(here.database, here.clock()) if is_admin else (),
        roles=ROLES,
        role_words=ROLE_WORDS,
        problem=problem,
        is_admin=is_admin,
        name=g.researcher.name,
    )
