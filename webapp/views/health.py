"""Whether the server can do its work, for whoever watches over it."""

from flask import Blueprint, Response

from webapp.views.services import services

bp = Blueprint("health", __name__)


@bp.get("/healthz")
def health() -> Response:
    """Answer `ok` after a real write, undone again; if nothing can be written the error page answers 503."""
    services().database.check_writable()
    return Response("ok\n", mimetype="text/plain")
