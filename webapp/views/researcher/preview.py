"""Every page of a study as a participant of any assignment would see it. Nothing is stored, and nobody takes part."""

import re
from dataclasses import dataclass
from typing import Any

from flask import abort, g, redirect, render_template, request, url_for
from flask.typing import ResponseReturnValue
from markupsafe import Markup

from webapp.storage.participants import Participant
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.session import Assignment, Page, pages, plan_trials
from webapp.views.answering import go_to
from webapp.views.pages import render_page
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import look
from webapp.views.researcher.words import PAGES
from webapp.views.visit import Visit

_NOBODY = -1
# What a page of the study leads to: its own address, an action of a drive, the way out.
_ADDRESS = re.compile(r'(action|href|data-returning|data-url)="/(?:study|leave|another-device)[^"]*"')


@dataclass(frozen=True, slots=True)
class Choice:
    """What is previewed.

    Attributes:
        assignments: For each experiment the arrangement and the order of layouts.
        language: The language of the pages.
        draw: Which draw of the random kind.
    """

    assignments: dict[str, Assignment]
    language: str
    draw: int

    def as_query(self) -> dict[str, Any]:
        """Return the address's parameters."""
        places = {f"in-{name}": f"{place.arrangement}.{place.layout_order}" for name, place in self.assignments.items()}
        return {**places, "language": self.language, "draw": str(self.draw)}


@bp.get("/preview")
def choose_preview() -> ResponseReturnValue:
    """Choose an assignment and a language, and see the list of pages."""
    choice = _choice()
    experiments = [
        (experiment, arrangements(experiment), layout_orders(experiment)) for experiment in look().study.experiments
    ]
    return render_template(
        "researcher/preview.html",
        choice=choice,
        experiments=experiments,
        visit_pages=_visit(choice, 1).pages,
        page_words=PAGES,
    )


@bp.get("/preview/<int:number>")
def preview_page(number: int) -> ResponseReturnValue:
    """Show one page."""
    choice = _choice()
    visit = _visit(choice, number)
    if not 1 <= number <= len(visit.pages):
        abort(404)
    page = visit.pages[number - 1]
    g.language = choice.language
    g.preview_banner = _banner(choice, page, len(visit.pages))
    return _ADDRESS.sub(lambda found: _lead_on(found, choice, number), render_page(visit, page))


@bp.post("/preview/<int:number>")
def send_preview(number: int) -> ResponseReturnValue:
    """Go on without storing anything."""
    choice = _choice()
    return go_to(_next(choice, number, len(_visit(choice, number).pages)))


@bp.post("/preview")
def begin_preview() -> ResponseReturnValue:
    """Go to the first page."""
    return redirect(url_for(".preview_page", number=1, **_choice().as_query()), code=303)


def _choice() -> Choice:
    study, told = look().study, request.values
    language, draw = told.get("language", study.languages[0]), told.get("draw", "0")
    if language not in study.languages or not _is_number(draw) or int(draw) >= study.explanation.num_draws:
        abort(404)
    chosen: dict[str, Assignment] = {}
    for experiment in study.experiments:
        arrangement, _, order = told.get(f"in-{experiment.id}", "0.0").partition(".")
        if not (_is_number(arrangement) and _is_number(order)):
            abort(404)
        place = Assignment(int(arrangement), int(order))
        if place.arrangement >= len(arrangements(experiment)) or place.layout_order >= len(layout_orders(experiment)):
            abort(404)
        chosen[experiment.id] = place
    return Choice(chosen, language, int(draw))


def _is_number(said: str) -> bool:
    """Tell whether something is a number that an index may have."""
    return re.fullmatch(r"[0-9]{1,12}", said) is not None


def _visit(choice: Choice, number: int) -> Visit:
    """Return the visit of somebody who does not exist."""
    found = look()
    planned = pages(found.study, plan_trials(found.study, choice.assignments, lambda: choice.draw))
    nobody = Participant(
        id=_NOBODY,
        code="preview",
        token_hash="preview",  # noqa: S106 - of nobody
        mode=found.scope.mode,
        study=found.scope.study,
        study_version=found.scope.study_version,
        language=choice.language,
        num_pages=len(planned),
        num_stored=number - 1,
        completed_at=None,
        withdrawn_at=None,
        screened_out_at=None,
        salt="",
        slot_released_at=None,
    )
    return Visit(nobody, found.catalogue, planned)


def _next(choice: Choice, number: int, num_pages: int) -> str:
    if number >= num_pages:
        return url_for(".choose_preview", **choice.as_query())
    return url_for(".preview_page", number=number + 1, **choice.as_query())


def _lead_on(found: re.Match[str], choice: Choice, number: int) -> str:
    """Let a form send nothing to the study, and a link lead back to the choice."""
    if found[1] == "href":
        address = url_for(".choose_preview", **choice.as_query())
    else:
        address = url_for(".preview_page", number=number, **choice.as_query())
    return Markup('{}="{}"').format(found[1], address)


def _banner(choice: Choice, page: Page, num_pages: int) -> Markup:
    """Return what stands above every page of the preview."""
    query = choice.as_query()
    links = [(url_for(".choose_preview", **query), "choose")]
    if page.number > 1:
        links.append((url_for(".preview_page", number=page.number - 1, **query), "previous page"))
    if page.number < num_pages:
        links.append((url_for(".preview_page", number=page.number + 1, **query), "next page"))
    said = Markup("<strong>Preview</strong>, page {} of {}; nothing is stored. ").format(page.number, num_pages)
    return said + Markup(" · ").join(Markup('<a href="{}">{}</a>').format(*link) for link in links)
