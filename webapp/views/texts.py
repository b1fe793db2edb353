"""What every template finds: the study, its texts, and who is signed in."""

from typing import Any

from flask import Flask, g

from webapp.stimuli.catalogue import Catalogue
from webapp.study.texts import Texts
from webapp.views.services import services


def language() -> str:
    """Return the language of the pages: the study's first."""
    return services().bundles.current.study.languages[0]


def texts() -> Texts:
    """Return the texts of the study version that the request is about: the visitor's, else the current one."""
    catalogue: Catalogue = g.get("catalogue", services().bundles.current)
    return catalogue.texts(catalogue.study.languages[0])


def init_texts(app: Flask) -> None:
    """Give every template its common names."""

    @app.context_processor
    def _common() -> dict[str, Any]:
        t, here = texts(), services()
        researcher = g.get("researcher")
        return {
            "t": t,
            "study": here.bundles.current.study,
            "language": language(),
            "banner": None if here.config.live else t("page.test_banner"),
            "signed_in": None if researcher is None else researcher.name,
        }
