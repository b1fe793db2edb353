"""Fit the ordinal mixed model to 20,000 ratings of 2,000 people; on a tenth of them beside R's ordinal::clmm.

python -m tests.benchmarks.ordinal [--without-r]

Ten ratings each, of three kinds on five layouts, on five points. R's time is that of the fit alone, without loading;
where R or its package ordinal is missing this is said, and only the promise about our own time is checked.
"""

import argparse
import json
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from webapp.analysis.planned_model import PlannedFit, fit_planned

NUM_PEOPLE, NUM_EACH = 2_000, 10
NUM_BESIDE_R = 200
"""R took more than eight minutes for all of them."""
PROMISED_S = 20.0
_SCRIPT = """
suppressMessages(library(ordinal))
data <- read.csv(commandArgs(TRUE)[1])
data$rating <- factor(data$rating, ordered = TRUE)
for (name in c("participant", "kind", "layout", "trial")) data[[name]] <- factor(data[[name]])
took <- system.time(fit <- clmm(rating ~ kind + layout + trial + (1 | participant), data, link = "probit", nAGQ = 11))
cat(sprintf('{"seconds": %.3f, "kinds": [%.10f, %.10f], "log_likelihood": %.6f}\\n', took[["elapsed"]],
            fit$beta[["kindrandom"]], fit$beta[["kindsubgoals"]], as.numeric(logLik(fit))))
"""


def main() -> int:
    """Print both times, their ratio and how far the estimates lie apart; return 0 if the promise is kept."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--without-r", action="store_true")
    options = parser.parse_args()
    frame = _ratings()
    _, ours = _fitted(frame)
    kept = ours <= PROMISED_S
    verdict = "kept" if kept else "BROKEN"
    print(f"{len(frame):,} ratings of {NUM_PEOPLE:,} people: {ours:.2f} s, promised {PROMISED_S:.0f} s, {verdict}")
    if not options.without_r:
        some = frame[frame["participant"] < NUM_BESIDE_R]
        _beside_r(some, *_fitted(some))
    return 0 if kept else 1


def _fitted(frame: pd.DataFrame) -> tuple[PlannedFit, float]:
    """Return the model and the median of three times, in seconds."""
    times = []
    for _ in range(3):
        begun = time.perf_counter()
        planned = fit_planned(frame, ("full", "random", "subgoals"))
        times.append(time.perf_counter() - begun)
    return planned, statistics.median(times)


def _ratings() -> pd.DataFrame:
    rng = np.random.default_rng(2021)
    people = np.repeat(np.arange(NUM_PEOPLE), NUM_EACH)
    kinds = np.array(["full", "random", "subgoals"])[rng.integers(0, 3, len(people))]
    layouts = np.array(list("abcde"))[rng.integers(0, 5, len(people))]
    latent = rng.normal(0, 0.6, NUM_PEOPLE)[people] + rng.normal(0, 0.8, len(people)) + 0.4 * (kinds == "subgoals")
    ratings = np.clip(np.round(3 + latent), 1, 5).astype(int)
    trials = np.tile(np.arange(1, NUM_EACH + 1), NUM_PEOPLE)
    columns = {"participant": people, "trial": trials, "layout": layouts, "kind": kinds, "rating": ratings}
    return pd.DataFrame(columns)


def _beside_r(frame: pd.DataFrame, planned: PlannedFit, ours: float) -> None:
    if shutil.which("Rscript") is None:
        print("R is not installed, so there is no comparison (Debian: r-base-core, r-cran-ordinal)")
        return
    with tempfile.TemporaryDirectory() as name:
        script, data = Path(name) / "fit.R", Path(name) / "ratings.csv"
        script.write_text(_SCRIPT, encoding="utf-8")
        frame.to_csv(data, index=False)
        done = subprocess.run(  # noqa: PLW1510 - told below
            ["Rscript", "--vanilla", str(script), str(data)],  # noqa: S607 - whichever R there is.
            capture_output=True,
            text=True,
            timeout=1800,
        )
    if done.returncode:
        print(f"R could not fit it: {done.stderr.strip().splitlines()[-1:]}")
        return
    theirs = json.loads(done.stdout)
    apart = max(abs(a - b) for a, b in zip(planned.fit.coefficients[:2], theirs["kinds"], strict=True))
    print(f"{len(frame):,} ratings: {ours:.3f} s; ordinal::clmm, 11 nodes: {theirs['seconds']:.1f} s, ", end="")
    print(f"{theirs['seconds'] / ours:.0f} times as long")
    print(
        f"coefficients of kinds: at most {apart:.1e} apart; log-likelihoods: {planned.fit.log_likelihood:.4f} and ",
        end="",
    )
    print(f"{theirs['log_likelihood']:.4f}")


if __name__ == "__main__":
    raise SystemExit(main())
