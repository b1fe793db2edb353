"""One table from errors to pages: which status, and which of the study's texts."""

import logging
from dataclasses import dataclass
from http import HTTPStatus

from flask import Flask, Response, make_response, render_template, request, url_for
from jinja2 import TemplateNotFound
from werkzeug.exceptions import HTTPException, SecurityError

from webapp.storage.database import UnavailableError
from webapp.storage.enrolment import AlreadyTookPartError
from webapp.study.session import NoSuchPageError
from webapp.views.logs import request_fields, request_id
from webapp.views.security import CrossSiteError, cookie_name
from webapp.views.services import StudyChangedError, services
from webapp.views.texts import catalogue, texts
from webapp.views.visit import NoPlaceError

_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ErrorPage:
    """What somebody sees when something goes wrong.

    Attributes:
        status: The HTTP status.
        title: The key of the study's text that says what happened.
        message: The key of the text that says what to do.
    """

    status: int
    title: str
    message: str


DOMAIN_ERRORS: dict[type[Exception], ErrorPage] = {
    NoSuchPageError: ErrorPage(404, "error_pages.not_found_title", "error_pages.not_found"),
    NoPlaceError: ErrorPage(403, "error_pages.no_place_title", "error_pages.no_place"),
    CrossSiteError: ErrorPage(403, "error_pages.refused_title", "error_pages.refused"),
    StudyChangedError: ErrorPage(410, "error_pages.study_changed_title", "error_pages.study_changed"),
    AlreadyTookPartError: ErrorPage(409, "took_part.title", "took_part.text"),
    UnavailableError: ErrorPage(503, "error_pages.busy_title", "error_pages.busy"),
    OSError: ErrorPage(503, "error_pages.busy_title", "error_pages.busy"),  # The disk did not give a file, or no more.
}

_HTTP_ERRORS = {
    404: ErrorPage(404, "error_pages.not_found_title", "error_pages.not_found"),
    405: ErrorPage(405, "error_pages.not_found_title", "error_pages.not_found"),
    413: ErrorPage(413, "error_pages.refused_title", "error_pages.too_large"),
}
_ELSEWHERE = {
    "title": "This version is not here",
    "message": "These data are of another study, or of a version whose bundle is gone. "
    "Serve that study to look at them: xar serve --study NAME.",
}
"""What a researcher is told in place of what a participant would be."""

_KEPT_HEADERS = ("Allow", "Retry-After")


def init_errors(app: Flask) -> None:
    """Turn every error into a page."""
    app.register_error_handler(Exception, show_error)


def show_error(error: Exception) -> Response:
    """Answer with the page of an error; what is our fault is logged, with nothing about who asked."""
    page = error_page(error)
    if page.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        _LOGGER.error("request failed", extra={"fields": request_fields()}, exc_info=error)
    elif isinstance(error, CrossSiteError | SecurityError):
        _LOGGER.warning("refused: %s", type(error).__name__, extra={"fields": request_fields()})
    if isinstance(error, SecurityError):
        # Nothing can be linked to from a host that is not ours.
        response = make_response("This server has another name.\n", page.status)
        response.content_type = "text/plain; charset=utf-8"
    else:
        response = make_response(_render(page), page.status)
    if isinstance(error, HTTPException):
        kept = error.get_response().headers
        response.headers.update({name: kept[name] for name in _KEPT_HEADERS if name in kept})
    if page.status == HTTPStatus.SERVICE_UNAVAILABLE:
        response.headers.setdefault("Retry-After", "5")
    return response


def error_page(error: Exception) -> ErrorPage:
    """Look an error up."""
    for kind, page in DOMAIN_ERRORS.items():
        if isinstance(error, kind) and not isinstance(error, TemplateNotFound):  # It calls itself an OSError.
            return page
    status = error.code if isinstance(error, HTTPException) and error.code is not None else 500
    if status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        return ErrorPage(status, "error_pages.failed_title", "error_pages.failed")
    return _HTTP_ERRORS.get(status, ErrorPage(status, "error_pages.refused_title", "error_pages.refused"))


def _render(page: ErrorPage) -> str:
    t = texts()
    if request.path.startswith("/researcher/"):
        back = {"back_url": url_for("researcher.overview"), "back_label": "Go to the overview"}
    elif page is DOMAIN_ERRORS[NoPlaceError] or cookie_name(services().config, "participant") not in request.cookies:
        back = {"back_url": url_for("arrival.welcome"), "back_label": t("error_pages.begin")}
    else:
        back = {"back_url": url_for("participant.study"), "back_label": t("error_pages.back")}
    contact = t("done.contact", contact=catalogue().study.contact) if page.status == HTTPStatus.CONFLICT else None
    shown = {"status": page.status, "title": t(page.title), "message": t(page.message), "contact": contact}
    if page.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        shown["request_id"] = request_id()
    if page is DOMAIN_ERRORS[StudyChangedError] and request.path.startswith("/researcher/"):
        shown |= _ELSEWHERE
    return render_template("errors/error.html", **shown, **back)
