"""The declared exclusion rules: how many they flag, and whom; beside them who left the window, which is no rule."""

from flask import render_template
from flask.typing import ResponseReturnValue

from webapp.storage.dashboard import excluded_people
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import look
from webapp.views.researcher.words import RULES
from webapp.views.services import services

NUM_SHOWN = 200
"""How many flagged people are listed at most; the list of people has them all."""


@bp.get("/quality")
def quality() -> ResponseReturnValue:
    """Show rules, flags and exclusions."""
    here, found = services(), look()
    people = here.live.people(found.study, found.scope, here.clock(), flagged=True, per_page=NUM_SHOWN)
    return render_template(
        "researcher/quality.html",
        numbers=found.numbers(),
        flagged=people,
        excluded=excluded_people(here.database, found.scope),
        rules=RULES,
    )
