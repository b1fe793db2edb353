"""The list of people, live and searchable."""

from dataclasses import dataclass
from typing import get_args

from flask import abort, jsonify, render_template, request
from flask.typing import ResponseReturnValue

from webapp.storage.dashboard import head_of_log
from webapp.storage.live_numbers import State
from webapp.storage.live_person_numbers import PeoplePage
from webapp.study.quality import declared_rules
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import head_as_json, look
from webapp.views.researcher.overview import line_as_json, marks
from webapp.views.researcher.words import RULES, STATES
from webapp.views.services import services

PER_PAGE = 100
_MAX_SEARCH_LENGTH = 32
_FLAGGED = {"yes": True, "no": False, "": None}
_ALL = 1_000_000
"""More people than there are."""


@dataclass(frozen=True, slots=True)
class Filters:
    """Which people are listed.

    Attributes:
        state: Only those who are there; empty for all.
        flagged: `yes`, `no`, the name of a declared rule, or empty for all.
        excluded: `yes`, or empty for all.
        search: A part of the code.
        page: From 1.
    """

    state: str
    flagged: str
    excluded: str
    search: str
    page: int

    def as_query(self, page: int | None = None) -> dict[str, str | int]:
        """Return the address's parameters, without empty ones."""
        told: dict[str, str | int] = {
            "state": self.state,
            "flagged": self.flagged,
            "excluded": self.excluded,
            "search": self.search,
            "page": page or self.page,
        }
        return {name: value for name, value in told.items() if value not in ("", 1)}


@bp.get("/people")
def people() -> ResponseReturnValue:
    """List people."""
    filters = _filters()
    return render_template(
        "researcher/people.html",
        people=_people(filters),
        filters=filters,
        states=STATES,
        rules={rule: RULES[rule] for rule in declared_rules(look().study.quality)},
        marks=marks,
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
    excluded = told.get("excluded", "")
    is_known = state in {"", *STATES} and flagged in {*_FLAGGED, *RULES} and excluded in {"", "yes"}
    if not (is_known and page.isdecimal()):
        abort(404)
    return Filters(state, flagged, excluded, told.get("search", "")[:_MAX_SEARCH_LENGTH].strip(), int(page[:6]))


def _people(filters: Filters) -> PeoplePage:
    here, found = services(), look()
    state = next((known for known in get_args(State) if known == filters.state), None)
    is_narrow = filters.flagged in RULES or filters.excluded == "yes"
    people = here.live.people(
        found.study,
        found.scope,
        here.clock(),
        state=state,
        flagged=_FLAGGED.get(filters.flagged, True),
        search=filters.search,
        page=1 if is_narrow else filters.page,
        per_page=_ALL if is_narrow else PER_PAGE,
    )
    return _narrowed(people, filters) if is_narrow else people


def _narrowed(people: PeoplePage, filters: Filters) -> PeoplePage:
    """Return a page of those among all people whom one rule flags, or who are excluded."""
    found = [
        line
        for line in people.lines
        if (filters.flagged not in RULES or filters.flagged in line.flags)
        and (filters.excluded != "yes" or line.excluded is not None)
    ]
    num_pages = max(1, -(-len(found) // PER_PAGE))
    number = min(max(1, filters.page), num_pages)
    return PeoplePage(tuple(found[(number - 1) * PER_PAGE : number * PER_PAGE]), len(found), number, num_pages)
