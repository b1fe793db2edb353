"""The headers that every answer has, whatever the route, the method and the status."""

from collections.abc import Mapping

from werkzeug.test import TestResponse

ALWAYS: Mapping[str, str] = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), display-capture=(), geolocation=(), microphone=(), payment=(), usb=()",
}
"""Each with its exact value."""

HSTS = "max-age=31536000; includeSubDomains"
KEPT = "public, max-age=31536000, immutable"
"""Of files whose address changes with them: static files and pictures."""

NEVER = (
    "Server",
    "X-Powered-By",
    "X-XSS-Protection",
    "Access-Control-Allow-Origin",
    "Access-Control-Allow-Credentials",
)
"""What would tell a version, is obsolete, or would open answers to other sites."""

TYPES = {
    "text/html; charset=utf-8",
    "text/plain; charset=utf-8",
    "text/css; charset=utf-8",
    "text/csv; charset=utf-8",
    "text/javascript; charset=utf-8",
    "image/svg+xml; charset=utf-8",
    "application/json",
    "application/zip",
    "image/png",
}


def faults(answer: TestResponse, *, https: bool = False, is_kept: bool = False) -> list[str]:
    """Say what is wrong with the headers of an answer; nothing if they are exactly as they should be.

    Args:
        answer: The answer.
        https: Whether the site is reached by https.
        is_kept: Whether a browser may keep the answer.
    """
    headers = answer.headers
    wanted: dict[str, str | None] = {**ALWAYS, **dict.fromkeys(NEVER)}
    wanted["Strict-Transport-Security"] = HSTS if https else None
    wanted["Cache-Control"] = KEPT if is_kept else "no-store"
    found = [f"{name}: {headers.get(name)!r}" for name, value in wanted.items() if headers.get(name) != value]
    found += [f"{name} twice" for name in ALWAYS if len(headers.getlist(name)) > 1]
    if not is_kept and "Cookie" not in headers.get("Vary", ""):
        found.append(f"Vary: {headers.get('Vary')!r}")
    if headers.get("Content-Type") not in TYPES and answer.status_code != 304:
        found.append(f"Content-Type: {headers.get('Content-Type')!r}")
    return found
