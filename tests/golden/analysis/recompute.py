"""Compute the golden numbers of the analysis anew with R, and compare them with those that are committed.

python -m tests.golden.analysis.recompute

It runs each `*.R` of this folder on a copy and compares the JSON files number by number, to 1e-4 for the mixed models,
whose optimizers differ between versions, and to 1e-8 for the rest. Nothing here is changed.
"""

import json
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
PACKAGES = "r-base-core r-cran-ordinal r-cran-lme4 r-cran-car r-cran-emmeans r-cran-jsonlite r-cran-pwr r-cran-survival"
_TOLERANCE = {"clmm.json": 1e-4, "mixed_logistic.json": 1e-4}


def main() -> int:
    """Print each difference, and return 0 if there is none, 1 if there is, 2 if R or a package is missing."""
    if shutil.which("Rscript") is None:
        print(f"R is needed and was not found; on Debian: apt-get install {PACKAGES}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "analysis"
        shutil.copytree(HERE, folder)
        for script in sorted(folder.glob("*.R")):
            done = subprocess.run(  # noqa: PLW1510 - told below
                ["Rscript", "--vanilla", script.name],  # noqa: S607 - whichever R there is.
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=600,
            )
            if done.returncode:
                print(f"{script.name}: {done.stderr.strip()}\non Debian: apt-get install {PACKAGES}", file=sys.stderr)
                return 2
        known = sorted(HERE.glob("*.json"))
        found = [line for path in known for line in _differences(path, folder / path.name)]
    print("\n".join(found) or f"{len(known)} files: R gives the committed numbers")
    return 1 if found else 0


def _differences(committed: Path, computed: Path) -> Iterator[str]:
    tolerance = _TOLERANCE.get(committed.name, 1e-8)
    ours, theirs = (dict(_leaves(json.loads(path.read_text(encoding="utf-8")))) for path in (committed, computed))
    for key in sorted({*ours, *theirs}):
        a, b = ours.get(key), theirs.get(key)
        if isinstance(a, int | float) and isinstance(b, int | float):
            if not math.isclose(a, b, rel_tol=tolerance, abs_tol=tolerance):
                yield f"{committed.name} {key}: committed {a}, computed {b}"
        elif a != b and not key.startswith("/versions"):
            yield f"{committed.name} {key}: committed {a!r}, computed {b!r}"


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - whatever JSON holds
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, f"{path}/{key}")
    elif isinstance(value, list):
        for place, inner in enumerate(value):
            yield from _leaves(inner, f"{path}/{place}")
    else:
        yield path, value


if __name__ == "__main__":
    raise SystemExit(main())
