"""The list of people, live and searchable."""

from dataclasses import dataclass
from typing import get_args

from flask import abort, jsonify, render_template, request
from flask.typing import ResponseReturnValue

from webapp.storage.dashboard import head_of_log
from webapp.storage.live_numbers import State
from webapp.storage.live_person_numbers import PeoplePage
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import head_as_json, look
from webapp.views.researcher.overview import line_as_json, marks
from webapp.views.researcher.words import STATES
from webapp.views.services import services

PER_PAGE = 100
_MAX_SEARCH_LENGTH = 32
_FLAGGED = {"yes": True, "no": False, "": None}


@dataclass(frozen=True, slots=True)
class Filters:
    """Which people are listed.

    Attributes:
        state: Only those who are there; empty for all.
        flagged: `yes`, `no`, or empty for all.
        search: A part of the code.
        page: From 1.
    """

    state: str
    flagged: str
    search: str
    page: int

    def as_query(self, page: int | None = None) -> dict[str, str | int]:
        """Return the address's parameters, without empty ones."""
        told: dict[str, str | int] = {
            "state": self.state,
            "flagged": self.flagged,
            "search": self.search,
            "page": page or self.page,
        }
        return {name: value for name, value in told.items() if value not in ("", 1)}


@bp.get("/people")
def people() -> ResponseReturnValue:
    """List people."""
    filters = _filters()
    return render_template(
        "researcher/people.html", people=_people(filters), filters=filters, states=STATES, marks=marks
    )


@bp.get("/people.json")
def people_status() -> ResponseReturnValue:
    """Send the list to the open page."""
    found = _people(_filters())
    return jsonify(
        participants=[line_as_json(line) for line in found.lines],
        num_found=found.num_found,
        head=head_as_json(head_of_log(services().database)),
    )


def _filters() -> Filters:
    told = request.args
    state, flagged, page = told.get("state", ""), told.get("flagged", ""), told.get("page", "1")
    if state not in {"", *STATES} or flagged not in _FLAGGED or not page.isdecimal():
        abort(404)
    return Filters(state, flagged, told.get("search", "")[:_MAX_SEARCH_LENGTH].strip(), int(page[:6]))


def _people(filters: Filters) -> PeoplePage:
    here, found = services(), look()
    state = next((known for known in get_args(State) if known == filters.state), None)
    return here.live.people(
        found.study,
        found.scope,
        here.clock(),
        state=state,
        flagged=_FLAGGED[filters.flagged],
        search=filters.search,
        page=filters.page,
        per_page=PER_PAGE,
    )
