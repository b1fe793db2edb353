"""What every template finds: the study, its texts, and who is signed in."""

from typing import Any

from flask import Flask, g

from webapp.stimuli.catalogue import Catalogue
from webapp.study.texts import Texts
from webapp.views.services import services


def language() -> str:
    """Return the language of the pages: the study's first."""
    return _catalogue().study.languages[0]


def texts() -> Texts:
    """Return the texts of the study version that the request is about."""
    return _catalogue().texts(language())


def init_texts(app: Flask) -> None:
    """Give every template its common names."""

    @app.context_processor
    def _common() -> dict[str, Any]:
        t = texts()
        researcher = g.get("researcher")
        return {
            "t": t,
            "study": _catalogue().study,
            "language": language(),
            "banner": None if services().config.live else t("page.test_banner"),
            "signed_in": None if researcher is None else researcher.name,
        }


def _catalogue() -> Catalogue:
    """Return the study version that the request is about: the visitor's, else the current one."""
    catalogue: Catalogue = g.get("catalogue", services().bundles.current)
    return catalogue
