"""What the running study declares."""

from dataclasses import dataclass

from flask import render_template
from flask.typing import ResponseReturnValue

from webapp.stimuli.catalogue import BundleError
from webapp.stimuli.publication import published_bundle
from webapp.study.counterbalancing import arrangements, layout_orders
from webapp.study.quality import declared_rules, rule_words
from webapp.views.researcher.door import bp
from webapp.views.researcher.frame import look
from webapp.views.services import services


@dataclass(frozen=True, slots=True)
class Size:
    """How large an experiment is.

    Attributes:
        num_arrangements: In how many ways kinds go with layouts.
        num_orders: In how many orders the layouts come.
    """

    num_arrangements: int
    num_orders: int


@bp.get("/study")
def study_page() -> ResponseReturnValue:
    """Show the declaration, and lead to the preview."""
    declared = look().study
    sizes = {
        experiment.id: Size(len(arrangements(experiment)), len(layout_orders(experiment)))
        for experiment in declared.experiments
    }
    return render_template(
        "researcher/study.html",
        declared=declared,
        sizes=sizes,
        rules=[rule_words(declared.quality, rule) for rule in declared_rules(declared.quality)],
        published=_published(),
    )


def _published() -> str | None:
    """Return the version that is frozen for participants; None if none is."""
    try:
        return published_bundle(services().config.instance, look().study.name).name
    except BundleError:
        return None
