"""The first page: everybody together, live."""

from dataclasses import asdict
from datetime import datetime
from typing import Any

from flask import jsonify, render_template
from flask.typing import ResponseReturnValue

from webapp.storage.condition import Condition, condition
from webapp.storage.live_numbers import FunnelStep
from webapp.storage.live_person_numbers import PeoplePage, PersonLine
from webapp.views.researcher.charts import SHARES, time_axis
from webapp.views.researcher.door import bp, researcher
from webapp.views.researcher.frame import head_as_json, look
from webapp.views.researcher.words import PAGES, RULES, STATES, drop_out_words, seconds_words
from webapp.views.services import services

NOTHING = "\N{EN DASH}"
"""What stands for a number that there is not."""

NUM_LATEST = 12
"""How many people the overview lists."""


@bp.get("/")
def overview() -> ResponseReturnValue:
    """Show the numbers."""
    numbers, balance = look().numbers_and_balance()
    return render_template(
        "researcher/overview.html",
        server=_condition() if researcher().may("admin") else None,
        numbers=numbers,
        balance=balance,
        people=latest_people(),
        marks=marks,
        pages=PAGES,
        states=STATES,
        rules=RULES,
        shares=SHARES,
        funnel=funnel_rows(numbers.funnel),
        times=time_axis([entry.upper_quartile_s for entry in numbers.page_times]),
        seconds=seconds_words,
        drop_out_words=drop_out_words,
    )


@bp.get("/status.json")
def status() -> ResponseReturnValue:
    """Send the live numbers to the open dashboard; results are not among them, and arms are masked as on the page."""
    numbers, balance = look().numbers_and_balance()
    return jsonify(
        counts=asdict(numbers.counts),
        cells=[asdict(cell) for cell in numbers.cells],
        layouts=[asdict(layout) for layout in balance],
        funnel=funnel_rows(numbers.funnel),
        participants=[line_as_json(line) for line in latest_people().lines],
        num_elsewhere=numbers.num_elsewhere,
        head=head_as_json(numbers.head),
    )


def _condition() -> Condition:
    here = services()
    return condition(here.database, here.config.backup_folder, here.clock(), is_live=here.config.live)


def latest_people() -> PeoplePage:
    """Return those who arrived last."""
    here, found = services(), look()
    return here.live.people(found.study, found.scope, here.clock(), per_page=NUM_LATEST)


def funnel_rows(steps: tuple[FunnelStep, ...]) -> list[dict[str, Any]]:
    """Return each step with its share of the first one, which its bar shows."""
    first = steps[0].count if steps else 0
    return [
        {
            "name": step.name,
            "count": step.count,
            "of_previous": NOTHING if step.of_previous is None else f"{100 * step.of_previous:.0f} %",
            "of_first": f"{100 * step.count / first:.0f} %" if first else NOTHING,
            "width": f"{100 * step.count / first:.2f}%" if first else "0%",
        }
        for step in steps
    ]


def line_as_json(line: PersonLine) -> dict[str, Any]:
    """Return a line of the list for an open page."""
    return {
        "code": line.code,
        "state": line.state,
        "state_words": STATES[line.state],
        "progress": line.progress,
        "num_pages": line.num_pages,
        "last_seen": _iso(line.last_seen),
        "minutes": f"{line.minutes:.1f}",
        "marks": marks(line),
    }


def marks(line: PersonLine) -> list[str]:
    """Return what is to be seen of a person at a glance: excluded, late, flags."""
    decided = ["excluded"] if line.excluded is not None else []
    late = ["came back late"] if line.is_late else []
    return [*decided, *late, *(RULES[rule] for rule in RULES if rule in line.flags)]


def _iso(time: datetime) -> str:
    return time.isoformat(timespec="seconds").replace("+00:00", "Z")
