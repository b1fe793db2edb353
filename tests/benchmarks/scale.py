"""Time and weigh the exact importance of a whole path in key-door worlds of 10^4, 10^5 and 10^6 states.

python -m tests.benchmarks.scale

From the map, as text, to the numbers. Each world is solved in a process of its own, whose peak of memory is the
interpreter's and NumPy's included. The parts and the growth are told in the processor's time, so that what else the
machine does disturbs them little; the promise is about the wall's.
"""

import os

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # Before NumPy is loaded.

import json
import subprocess
import sys
import time
from itertools import pairwise
from typing import Any

SIZES = (34, 102, 320)
"""Cells a side, the outer walls included."""
MAX_SECONDS = 10.0
MAX_MIB = 2048.0
MAX_GROWTH = 1.5
"""So much more processor time per state may the largest world take than the smallest: growth is linear."""


def main() -> int:
    """Print one line per world and what was promised, and return 0 if all promises are kept."""
    print("cells a side |    states | path | enumeration s | planning s | importance s | sum s | wall s | peak MiB")
    worlds = [_measured(size) for size in SIZES]
    for size, world in zip(SIZES, worlds, strict=True):
        print(
            f"{size:12} | {world['states']:9,} | {world['steps']:4} | {world['enumeration']:13.2f} | "
            f"{world['planning']:10.2f} | {world['importance']:12.2f} | {world['processor']:5.2f} | "
            f"{world['wall']:6.2f} | {world['peak']:8.0f}"
        )
    growth = worlds[-1]["processor"] / worlds[-1]["states"] / (worlds[0]["processor"] / worlds[0]["states"])
    lines = [
        ("seconds on the wall, largest world", worlds[-1]["wall"], MAX_SECONDS),
        ("MiB, largest world", worlds[-1]["peak"], MAX_MIB),
        ("times the processor time per state of the smallest", growth, MAX_GROWTH),
    ]
    for name, measured, promise in lines:
        verdict = "kept" if measured <= promise else "BROKEN"
        print(f"{name:52} {measured:8.2f}   promised at most {promise:7.1f}   {verdict}")
    return 0 if all(measured <= promise for _, measured, promise in lines) else 1


def draw(size: int) -> str:
    """Draw two rooms side by side, key in the one and goal in the other, both far from the door between them."""
    wall, last = size // 2, size - 1
    rows = [["#" if x in (0, wall, last) or y in (0, last) else "." for x in range(size)] for y in range(size)]
    for symbol, x, y in (
        (">", 1, size // 4),
        ("K", wall // 2, last - 2),
        ("D", wall, size // 2),
        ("G", last - 1, last - 1),
    ):
        rows[y][x] = symbol
    return "\n".join("".join(row) for row in rows)


def solve(size: int) -> dict[str, Any]:
    """Solve one world in this process, and return what it took."""
    # Loaded here, so that the parent stays small and the peak is the solver's.
    from webapp.explainer.importance import exact_importance  # noqa: PLC0415
    from webapp.explainer.solvers import follow, plan  # noqa: PLC0415
    from webapp.explainer.worlds.key_door import tabulate  # noqa: PLC0415
    from webapp.explainer.worlds.layout import parse_layout  # noqa: PLC0415

    text = draw(size)
    began, moments = time.perf_counter(), [time.process_time()]
    mdp = tabulate(parse_layout(text))
    moments.append(time.process_time())
    policy = plan(mdp)
    path = follow(mdp, policy)
    moments.append(time.process_time())
    exact_importance("return_probability", mdp, policy, path)
    moments.append(time.process_time())
    laps = [after - before for before, after in pairwise(moments)]
    return {
        "states": mdp.num_states,
        "steps": path.num_steps,
        **dict(zip(("enumeration", "planning", "importance"), laps, strict=True)),
        "processor": sum(laps),
        "wall": time.perf_counter() - began,
        "peak": _peak_mib(),
    }


def _peak_mib() -> float:
    """The most memory that this process ever held at once."""
    import resource  # noqa: PLC0415 - There is none on Windows.

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def _measured(size: int) -> dict[str, Any]:
    words = [sys.executable, "-m", "tests.benchmarks.scale", str(size)]
    finished = subprocess.run(words, check=True, stdout=subprocess.PIPE)
    found: dict[str, Any] = json.loads(finished.stdout)
    return found


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(solve(int(sys.argv[1]))))
        sys.exit(0)
    sys.exit(main())
