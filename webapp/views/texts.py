"""What every template finds: the study, its texts, the language, and who is signed in."""

from collections.abc import MutableMapping
from typing import Any

from flask import Flask, g, request, session
from flask.templating import Environment

from webapp.stimuli.catalogue import Catalogue
from webapp.study.texts import Texts
from webapp.views.services import services

_CHOSEN = "language"


def language() -> str:
    """Return the language of the pages.

    A participant's is the one in which the consent was given. Before, it is the one that was chosen, by link or from
    the menu, else the best of those that the browser asks for, else the study's first.
    """
    known = catalogue().study.languages
    decided = g.get("language") or session.get(_CHOSEN)
    if decided in known:
        return str(decided)
    return request.accept_languages.best_match(known) or known[0]


def choose_language(chosen: str) -> bool:
    """Remember a language that was chosen, until the browser is closed; one that the study lacks is not taken."""
    if chosen not in catalogue().study.languages:
        return False
    session[_CHOSEN] = chosen
    return True


def texts() -> Texts:
    """Return the texts of the study version that the request is about."""
    return catalogue().texts(language())


def catalogue() -> Catalogue:
    """Return the study version that the request is about: the visitor's, else the current one."""
    found: Catalogue = g.get("catalogue", services().bundles.current)
    return found


class _Environment(Environment):
    """Templates whose global names are all known before the first of them is rendered."""

    def make_globals(self, d: MutableMapping[str, Any] | None) -> MutableMapping[str, Any]:
        """Return the names in one mapping, which is copied for each page: of a chain of two that takes long."""
        return {**self.globals, **(d or {})}


def init_texts(app: Flask) -> None:
    """Give every template its common names, and macros the texts: these are imported without the page's own names."""
    app.jinja_environment = _Environment

    @app.template_global("t")
    def _text(key: str, /, **parameters: object) -> str:
        t: Texts = g.texts
        return t(key, **parameters)

    @app.context_processor
    def _common() -> dict[str, Any]:
        t = g.texts = texts()
        study = catalogue().study
        researcher = g.get("researcher")
        return {
            "t": t,
            "study": study,
            "language": t.language,
            "language_names": {code: catalogue().texts(code)("page.language_name") for code in study.languages},
            "logs_behaviour": study.behaviour_log is not None,
            "banner": None if services().config.live else t("page.test_banner"),
            "signed_in": None if researcher is None else researcher.name,
        }
