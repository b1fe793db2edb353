"""Who was given what: cells, arrangements, drop-out per arm, and the proof that chance alone decided."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from flask import render_template
from flask.typing import ResponseReturnValue

from webapp.storage.live_numbers import CellUse
from webapp.storage.replay import Replay, replay
from webapp.views.researcher.charts import SHARES
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import look
from webapp.views.researcher.words import drop_out_words
from webapp.views.services import services


@dataclass(frozen=True, slots=True)
class Held:
    """How many arrangements of an experiment are held by so many people.

    Attributes:
        experiment: The experiment's id.
        times: By how many people each of them is held.
        num_arrangements: How many arrangements that are.
    """

    experiment: str
    times: int
    num_arrangements: int


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
    numbers, balance = found.numbers_and_balance()
    return render_template(
        "researcher/allocation.html",
        numbers=numbers,
        balance=balance,
        arranged=found.mask.arrangements(found.study, numbers.arrangements),
        held=held(numbers.arrangements),
        replayed=replayed,
        shares=SHARES,
        drop_out_words=drop_out_words,
    )


def held(uses: Iterable[CellUse]) -> Sequence[Held]:
    """Return the distribution that is told while arms are masked, because arrangements follow from the kinds."""
    counted = Counter((use.experiment, use.counted) for use in uses)
    return [Held(experiment, times, number) for (experiment, times), number in sorted(counted.items())]
