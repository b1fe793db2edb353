"""The importance experiment (Sakai et al. 2021, section 5.1): importance, subgoals, key points and explanation.

The paper derives all four for one map with a learned agent and says in words what came out. Here every state of the
path gets its importance exactly and by Algorithm 1, on the rules and in the learned world model, so that it shows how
much of the result is the method's, the sampling's and the learning's.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import pandas as pd

from webapp.explainer.explanation import certain
from webapp.explainer.importance import ProbabilityKind
from webapp.explainer.on_demand import answer
from webapp.explainer.requests import Request
from webapp.explainer.subjects import MapSource
from webapp.simulations.conceptual import conceptual_rows, draw_conceptual
from webapp.simulations.derivation_figure import draw_derivation
from webapp.simulations.importance_claims import claims_about
from webapp.simulations.importance_figures import draw_importance
from webapp.simulations.importance_rows import ESTIMATORS, Estimator, rows_of
from webapp.simulations.importance_settings import SETTINGS, ImportanceSettings
from webapp.simulations.importance_summary import summary

__all__ = ["SETTINGS", "ImportanceSettings", "run", "summarise"]


def run(settings: ImportanceSettings, cache: Path, progress: Callable[[str, float], None]) -> pd.DataFrame:
    """Estimate the importance of each state of the path in every way.

    Torch is loaded for what is sampled or learned.

    Args:
        settings: What to compute.
        cache: The folder in which trained networks are kept by content; it is made when needed.
        progress: Told what is being estimated, or trained, and how much of that is done, from 0 to 1.

    Returns:
        One row per importance, estimator and step; `importance_rows` describes the columns.

    Raises:
        NotLearned: The networks did not learn the map within their budget.
        NeverArrives: The learned agent does not reach the goal in its own world model.
    """
    estimators = [name for name, (world, _, _) in ESTIMATORS.items() if settings.learned or world == "exact"]
    cells = list(product(settings.importances, estimators))
    frames = []
    for number, (kind, estimator) in enumerate(cells):
        progress(f"{kind}, {estimator}", number / len(cells))
        frames.append(_estimated(settings, kind, estimator, cache, progress))
    progress("all estimated", 1.0)
    return pd.concat(frames, ignore_index=True)


def summarise(settings: ImportanceSettings, rows: pd.DataFrame) -> dict[str, bytes]:
    """Return the files that tell what was found, by name; the same settings and rows give the same bytes.

    Args:
        settings: Of the run.
        rows: What `run` returned, or the same read back from a file.
    """
    concept = conceptual_rows()
    claims = claims_about(settings, rows)
    files = draw_importance(settings, rows) | draw_derivation(settings, rows) | draw_conceptual(concept)
    files["rows.csv"] = rows.to_csv(index=False, lineterminator="\n").encode()
    files["claims.csv"] = claims.to_csv(index=False, lineterminator="\n").encode()
    files["summary.md"] = summary(settings, rows, claims, concept).encode()
    return files


def _estimated(
    settings: ImportanceSettings,
    kind: ProbabilityKind,
    estimator: Estimator,
    cache: Path,
    progress: Callable[[str, float], None],
) -> pd.DataFrame:
    world, policy, how = ESTIMATORS[estimator]
    request = Request(world, policy, kind, how, settings.random_steps, num_trials=settings.num_trials)
    source = MapSource(settings.map, settings.layout_name)
    found = answer(source, replace(request, seed=settings.seed), cache, progress)
    return rows_of(found.explanation, certain(found.subject.world), kind, estimator, settings.num_trials)
