"""Who was given what: cells, arrangements, drop-out per arm, and the proof that chance alone decided."""

from flask import render_template
from flask.typing import ResponseReturnValue

from webapp.storage.replay import Replay, replay
from webapp.views.researcher.charts import SHARES
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import look
from webapp.views.researcher.words import drop_out_words
from webapp.views.services import services


@bp.get("/allocation")
def allocation() -> ResponseReturnValue:
    """Show the balance."""
    return _page(None)


@bp.post("/allocation/replay")
def replay_allocation() -> ResponseReturnValue:
    """Draw everything again and say what came of it; nothing is changed."""
    return _page(replay(services().database))


def _page(replayed: Replay | None) -> str:
    found = look()
    numbers = found.numbers()
    arranged = [found.mask.arrangement(found.study, use) for use in numbers.arrangements]
    if not found.mask.is_open:
        arranged.sort(key=lambda row: (row.use.experiment, -row.use.uses, -row.use.counted, -row.use.completed))
    return render_template(
        "researcher/allocation.html",
        numbers=numbers,
        arranged=arranged,
        replayed=replayed,
        shares=SHARES,
        drop_out_words=drop_out_words,
    )
