"""Flask's own cookie, which few requests have: it holds a notice, the chosen language and a recruiter's link."""

from flask import Flask, Request
from flask.sessions import SecureCookieSession, SecureCookieSessionInterface


class RareSessions(SecureCookieSessionInterface):
    """The same as Flask's, without the work for requests that have no such cookie."""

    def open_session(self, app: Flask, request: Request) -> SecureCookieSession | None:
        """Return what the cookie holds; an empty session where there is none."""
        if self.get_cookie_name(app) not in request.cookies:
            return self.session_class()
        return super().open_session(app, request)
