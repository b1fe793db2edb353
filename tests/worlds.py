"""Key-door worlds for tests: the study's six layouts, and maps of any size that nobody chose."""

from collections import deque
from pathlib import Path
from random import Random

from hypothesis import strategies as st

from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState, start_state, step
from webapp.explainer.worlds.layout import HEADINGS, Layout, parse_layout

LAYOUT_FILES = sorted((Path(__file__).parent.parent / "webapp" / "studies" / "sakai2021" / "layouts").glob("*.txt"))
LAYOUTS = {path.stem: parse_layout(path.read_text(encoding="utf-8"), path.name) for path in LAYOUT_FILES}
"""The six layouts of the study, by name."""


def lay_out(*rows: str) -> Layout:
    """Read a map written row by row in a test."""
    return parse_layout("\n".join(rows))


def reachable_states(layout: Layout, start: KeyDoorState | None = None) -> list[KeyDoorState]:
    """Return every state that can be reached, those on the goal included."""
    first = start or start_state(layout)
    known = {first}
    queue = deque([first])
    while queue:
        state = queue.popleft()
        if (state.x, state.y) == layout.goal:
            continue
        after = [step(layout, state, action)[0] for action in range(len(ACTIONS))]
        queue.extend(new for new in dict.fromkeys(after) if new not in known)
        known.update(after)
    return sorted(known)


@st.composite
def map_texts(draw: st.DrawFn, max_size: int = 30) -> str:
    """Draw a map that can be read, whether or not its goal can be reached."""
    width = draw(st.integers(3, max_size))
    height = draw(st.integers(3 if width > 5 else 6, max_size))  # Room for a key, a door, a goal and an agent.
    inner = [(x, y) for y in range(1, height - 1) for x in range(1, width - 1)]
    special = draw(st.lists(st.sampled_from(inner), min_size=4, max_size=4, unique=True))
    symbols = dict(zip(special, ["K", "D", "G", draw(st.sampled_from(HEADINGS))], strict=True))
    share = draw(st.sampled_from([0.0, 0.2, 0.5]))
    random = Random(draw(st.integers(0, 2**32 - 1)))
    floor = {cell: "#" if random.random() < share else "." for cell in inner}
    drawn = floor | symbols
    return "".join("".join(drawn.get((x, y), "#") for x in range(width)) + "\n" for y in range(height))


def layouts(max_size: int = 8) -> st.SearchStrategy[Layout]:
    """Draw worlds, small enough to be looked at in every state."""
    return map_texts(max_size).map(parse_layout)
