"""What holds for every request and every response: no forms from other sites, strict headers, closed cookies."""

from typing import Literal
from urllib.parse import urlsplit

from flask import Flask, Response, request

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
_STRICT_TRANSPORT = "max-age=31536000; includeSubDomains"


class CrossSiteError(PermissionError):
    """A form that was not sent from one of our own pages."""


def init_security(app: Flask, config: Config) -> None:
    """Check every request and complete every response of an app, whatever the route and the status."""
    app.before_request(refuse_other_sites)

    @app.after_request
    def _complete(response: Response) -> Response:
        response.headers.update(HEADERS)
        if config.https:
            response.headers["Strict-Transport-Security"] = _STRICT_TRANSPORT
        if not response.cache_control.immutable:
            response.headers["Cache-Control"] = "no-store"
            response.vary.add("Cookie")
        return response


def refuse_other_sites() -> None:
    """Refuse what changes something unless it comes from a page of ours.

    Browsers say so in `Sec-Fetch-Site`; where they do not (old ones, and all without https), `Origin` must name us.

    Raises:
        CrossSiteError: It comes from elsewhere, or does not say.
    """
    if request.method in _SAFE_METHODS:
        return
    site = request.headers.get("Sec-Fetch-Site")
    if site is not None:
        allowed = site in {"same-origin", "none"}
    else:
        allowed = urlsplit(request.headers.get("Origin", "")).netloc == request.host
    if not allowed:
        raise CrossSiteError(f"{request.method} {request.path} did not come from one of our pages")


CookieName = Literal["participant", "researcher", "notice"]


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
