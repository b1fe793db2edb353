"""What holds for every request and every response: no forms from other sites, strict headers, closed cookies."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal
from urllib.parse import urlsplit

from flask import Flask, Response, abort, request
from werkzeug.exceptions import SecurityError

from webapp.config import Config

_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS", "TRACE"})

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "form-action 'self'; frame-ancestors 'none'; base-uri 'none'; object-src 'none'"
)

HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    # Not `no-referrer`: browsers then send `Origin: null` with our own forms, and where there is no https they send no
    # Sec-Fetch-Site either, so that a form of ours could not be told from a foreign one.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), display-capture=(), geolocation=(), microphone=(), payment=(), usb=()",
}
_STRICT_TRANSPORT = {"Strict-Transport-Security": "max-age=31536000; includeSubDomains"}

_App = Callable[..., Iterable[bytes]]


class CrossSiteError(PermissionError):
    """A form that was not sent from one of our own pages."""


def init_security(app: Flask, config: Config) -> None:
    """Check every request and complete every response of an app, whatever the route and the status."""
    app.before_request(refuse_other_hosts)
    app.before_request(refuse_nul)
    app.before_request(refuse_other_sites)
    if config.https:
        app.wsgi_app = _as_https(app.wsgi_app)  # type: ignore[method-assign]
    app.wsgi_app = _with_headers(app.wsgi_app, _STRICT_TRANSPORT if config.https else {})  # type: ignore[method-assign]

    @app.after_request
    def _complete(response: Response) -> Response:
        if "immutable" not in response.headers.get("Cache-Control", ""):
            response.headers["Cache-Control"] = "no-store"
            vary_by(response, "Cookie")
        return response


def vary_by(response: Response, header: str) -> None:
    """Say that a response depends on a header of the request."""
    if "Vary" in response.headers:
        response.vary.add(header)
    else:  # Mostly, and in a tenth of the time.
        response.headers["Vary"] = header


def _with_headers(wsgi_app: _App, more: Mapping[str, str]) -> _App:
    """Let every response have `HEADERS` and more, however it came about."""

    def answer(environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        def start(status: str, headers: Sequence[tuple[str, str]], *error: Any) -> Any:  # noqa: ANN401 - as WSGI has it.
            return start_response(status, [*headers, *HEADERS.items(), *more.items()], *error)

        return wsgi_app(environ, start)

    return answer


def _as_https(wsgi_app: _App) -> _App:
    """Let full addresses begin with https, whatever the proxy says: a personal link must not travel in the clear."""

    def answer(environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
        return wsgi_app({**environ, "wsgi.url_scheme": "https"}, start_response)

    return answer


def refuse_other_hosts() -> None:
    """Refuse a name of the server that is not ours before anything else is: no page can be linked to from there.

    Raises:
        SecurityError: The request is for another host.
    """
    if isinstance(request.routing_exception, SecurityError):
        raise request.routing_exception


def refuse_nul() -> None:
    """Find nothing at an address with a NUL: no name that is in one has any, and PostgreSQL refuses to look for it."""
    if "\0" in request.path:
        abort(404)


def refuse_other_sites() -> None:
    """Refuse what changes something unless it comes from a page of ours.

    Browsers say so in `Sec-Fetch-Site`; where they do not (old ones, and all without https), `Origin` must name us.

    Raises:
        CrossSiteError: It comes from elsewhere, or does not say.
    """
    if request.method in _SAFE_METHODS:
        return
    site = request.headers.get("Sec-Fetch-Site")
    allowed = _is_ours(request.headers.get("Origin", "")) if site is None else site in {"same-origin", "none"}
    if not allowed:
        raise CrossSiteError(f"{request.method} {request.path} did not come from one of our pages")


def _is_ours(origin: str) -> bool:
    """Tell whether an origin is this server's; reached by https, it is not what somebody put in its place without."""
    parts = urlsplit(origin)
    return parts.netloc == request.host and (parts.scheme == "https" or not request.is_secure)


CookieName = Literal["participant", "researcher", "browser", "notice"]


def cookie_name(config: Config, name: CookieName) -> str:
    """Return the full name of a cookie: by https the browser then makes sure that no other host set it."""
    return f"__Host-{name}" if config.https else name


def set_cookie(
    response: Response,
    config: Config,
    name: CookieName,
    token: str,
    *,
    same_site: Literal["Lax", "Strict"],
    days: int | None,
) -> None:
    """Hand a browser its token, out of reach of scripts; without `days` until the browser is closed."""
    response.set_cookie(
        cookie_name(config, name),
        token,
        max_age=None if days is None else days * 24 * 3600,
        path="/",
        secure=config.https,
        httponly=True,
        samesite=same_site,
    )


def delete_cookie(response: Response, config: Config, name: CookieName) -> None:
    """Make a browser forget its token."""
    response.delete_cookie(cookie_name(config, name), path="/", secure=config.https, httponly=True)
