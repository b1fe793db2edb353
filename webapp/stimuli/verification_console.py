"""What came of building a bundle again, as a terminal shows it."""

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from webapp.stimuli.verification import PARTS, Part, Verified

_MOST_LISTED = 10


def render_verified(found: Verified) -> RenderableType:
    """Lay out a line for each part, the files that differ, and the verdict."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("part", no_wrap=True)
    table.add_column("files reproduced", no_wrap=True)
    for part in found.parts:
        table.add_row(PARTS[part.name], _reproduced(part))
    differences = [Text(f"Differs: {name}") for part in found.parts for name in _listed(part)]
    notes = [Text(f"Note: {note}") for note in found.notes]
    whole = "The stored files hash to the version's name." if found.is_whole else _DAMAGED
    return Group(Text(f"Version {found.version}"), table, *differences, *notes, whole, _VERDICT[found.is_proven])


_DAMAGED = "The stored files do not hash to the version's name: they were changed after it was built."
_VERDICT = {
    True: "Proven: built again from its own files, it shows participants the same.",
    False: "Not proven: built again from its own files, it is not the same.",
}


def _reproduced(part: Part) -> str:
    number = f"{part.num_reproduced} of {part.num_files}"
    return number if part.is_compared else f"{number} (taken from the bundle; --weights train proves them)"


def _listed(part: Part) -> list[str]:
    more = len(part.differences) - _MOST_LISTED
    return [*part.differences[:_MOST_LISTED], *([f"{more} more of {part.name}"] if more > 0 else [])]
