"""Time the pictures of a whole study against MiniGrid's own, and fail if the promise is broken.

python -m tests.benchmarks.pictures

Each contestant writes one PNG file for every reachable state of the study's six layouts, in a process of its own that
has drawn nothing before. The peer is MiniGrid's `get_pov_render` saved by Pillow as it comes, 288 pixels wide. Ours
are drawn twice: as wide, and with the two pixels per CSS pixel that a page shows, so with four times the peer's pixels.
The promise is judged both from the first call, when everything is imported, and by the life of the whole process.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from webapp.explainer.worlds.key_door import KeyDoorState, key_door_state, tabulate
from webapp.explainer.worlds.layout import Layout, parse_layout

if TYPE_CHECKING:
    from webapp.explainer.worlds.environment import KeyDoorEnv

ROOT = Path(__file__).parents[2]
LAYOUTS = ROOT / "webapp/studies/sakai2021/layouts"
REPEATS = 3
PROMISE = 5.0

World = tuple[Layout, list[KeyDoorState]]
"""A map and its reachable states."""


def main() -> int:
    """Print medians and their ratios, and return 0 if the promise is kept by both of ours."""
    all_worlds = worlds()
    num_states = sum(len(states) for _, states in all_worlds)
    runs: dict[str, list[tuple[float, float]]] = {name: [] for name in CONTESTANTS}
    # All is deleted in the end only: on some file systems, files are slow to make just after many were deleted.
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(REPEATS):
            for name in CONTESTANTS:
                runs[name].append(_measured(name, Path(tempfile.mkdtemp(dir=folder)), num_states))
    medians = {name: [statistics.median(column) for column in zip(*rows, strict=True)] for name, rows in runs.items()}
    print(f"PNG files of {num_states} states, medians of {REPEATS} processes: from the first call, whole process")
    kept = [_report(name, medians[name], medians[PEER]) for name in CONTESTANTS]
    return 0 if all(kept) else 1


def _measured(name: str, folder: Path, num_states: int) -> tuple[float, float]:
    """Let a contestant draw in a process of its own; return the seconds from its first call, and of its whole life."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "tests.benchmarks.pictures", name, str(folder)]
    answer = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    whole = time.perf_counter() - began
    assert [Image.open(file).size for file in folder.iterdir()] == [(EDGES[name], EDGES[name])] * num_states
    return float(answer.stdout), whole


def _report(name: str, medians: list[float], peer: list[float]) -> bool:
    line = f"{name:28} {medians[0]:7.2f} s {medians[1]:7.2f} s"
    if name == PEER:
        print(line)
        return True
    first, whole = (theirs / own for own, theirs in zip(medians, peer, strict=True))
    kept = min(first, whole) >= PROMISE
    verdict = "kept" if kept else "BROKEN"
    print(f"{line}   {first:5.1f} and {whole:5.1f} times faster   promised {PROMISE:3.0f}   {verdict}")
    return kept


def worlds() -> list[World]:
    """Return the study's maps with their reachable states, those on the goal included."""
    layouts = [parse_layout(file.read_text(encoding="utf-8"), file.name) for file in sorted(LAYOUTS.glob("*.txt"))]
    tables = [tabulate(layout) for layout in layouts]
    states = [[key_door_state(table, state) for state in range(table.num_states)] for table in tables]
    return list(zip(layouts, states, strict=True))


def draw_ours(folder: Path, size: int) -> float:
    """Write every state's picture, `size` CSS pixels wide; return the seconds from the first call."""
    from webapp.explainer.pictures.render import draw  # noqa: PLC0415 - A contestant loads its own libraries only.
    from webapp.explainer.worlds.view import egocentric_view  # noqa: PLC0415 - As above.

    all_worlds = worlds()
    began = time.perf_counter()
    for number, (layout, states) in enumerate(all_worlds):
        for i, state in enumerate(states):
            (folder / f"{number}-{i}.png").write_bytes(draw(egocentric_view(layout, state), size))
    return time.perf_counter() - began


def draw_minigrids(folder: Path) -> float:
    """Write every state's picture as MiniGrid and Pillow make it; return the seconds from the first call."""
    from webapp.explainer.worlds.environment import KeyDoorEnv  # noqa: PLC0415 - As above.

    all_worlds = [(KeyDoorEnv(layout), states) for layout, states in worlds()]
    began = time.perf_counter()
    for number, (environment, states) in enumerate(all_worlds):
        for i, state in enumerate(states):
            _enter(environment, state)
            picture = environment.get_pov_render(tile_size=96)  # type: ignore[no-untyped-call]
            Image.fromarray(picture).save(folder / f"{number}-{i}.png")
    return time.perf_counter() - began


def _enter(environment: "KeyDoorEnv", state: KeyDoorState) -> None:
    """Put the agent into any state; an episode cannot begin on the goal, so it is moved there."""
    layout = environment.layout
    if (state.x, state.y) != layout.goal:
        environment.reset(options={"state": state})
        return
    x, y = layout.start
    environment.reset(options={"state": state._replace(x=x, y=y)})
    environment.agent_pos = layout.goal


PEER = "MiniGrid and Pillow, 288 px"
CONTESTANTS: dict[str, Callable[[Path], float]] = {
    PEER: draw_minigrids,
    "ours, 288 px": partial(draw_ours, size=144),
    "ours, 576 px (288 CSS px)": partial(draw_ours, size=288),
}
EDGES = dict(zip(CONTESTANTS, (288, 288, 576), strict=True))

if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "1"
    if sys.argv[1:]:
        print(CONTESTANTS[sys.argv[1]](Path(sys.argv[2])))
        sys.exit(0)
    sys.exit(main())
