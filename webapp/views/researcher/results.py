"""What came out so far, with intervals. Arms are masked until an owner opens the mask, for themselves and on record."""

from collections.abc import Iterable
from operator import attrgetter

from flask import redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue

from webapp.storage.dashboard import num_corrections
from webapp.storage.live_outcomes import DriveSummary, PredictionSummary, Share
from webapp.storage.people import MAX_REASON_LENGTH, PersonError
from webapp.storage.unblinding import unblind
from webapp.views.researcher.charts import GAINS, SHARES, scale_axis
from webapp.views.researcher.door import NotConfirmedError, bp, confirm_password, requires, researcher
from webapp.views.researcher.frame import look
from webapp.views.services import services


@bp.get("/results")
def results() -> ResponseReturnValue:
    """Show ratings, predictions and drives."""
    return render_template(
        "researcher/results.html",
        numbers=look().numbers(),
        num_corrections=num_corrections(services().database, look().scope),
        scale=scale_axis,
        shares=SHARES,
        gains=GAINS,
        pick=_pick,
    )


@bp.get("/unblind")
@requires("owner")
def ask_to_unblind() -> ResponseReturnValue:
    """Ask for the password and a reason."""
    return _form()


@bp.post("/unblind")
@requires("owner")
def unblind_arms() -> ResponseReturnValue:
    """Show the arms to this account from now on; who asked, when and why is recorded."""
    here = services()
    try:
        confirm_password()
        unblind(here.database, researcher().name, look().scope, request.form.get("reason", ""), here.clock())
    except (NotConfirmedError, PersonError) as error:
        return _form(str(error)), 422
    return redirect(url_for(".results", done="unblinded"), code=303)


def _form(problem: str | None = None) -> str:
    reason = request.form.get("reason", "")
    return render_template(
        "researcher/unblind.html", problem=problem, reason=reason, max_reason_length=MAX_REASON_LENGTH
    )


def _pick(rows: Iterable[DriveSummary | PredictionSummary], path: str) -> list[tuple[str, Share | None]]:
    """Return each arm with one of its shares, such as `before.reached`."""
    return [(row.kind, attrgetter(path)(row)) for row in rows]
