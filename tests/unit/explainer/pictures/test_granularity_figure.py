"""The figure of one path at three granularities: the same each time, and the one in the documents is up to date."""

import struct
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.conftest import ROOT
from tests.worlds import LAYOUTS
from webapp.explainer.pictures.granularity_figure import draw, main, rows_of
from webapp.explainer.worlds.layout import parse_layout

FIGURES = {
    "granularity.png": LAYOUTS["simulation"],
    "granularity-four-rooms.png": parse_layout((ROOT / "docs/maps/four-rooms.txt").read_text(encoding="utf-8")),
}


@pytest.mark.parametrize("name", FIGURES)
def test_the_figure_in_the_documents_is_what_the_code_draws(name: str) -> None:
    drawn = draw(FIGURES[name])
    stored = (ROOT / "docs" / "images" / name).read_bytes()
    pictures = [np.asarray(Image.open(BytesIO(png)).convert("RGB"), dtype=np.float64) for png in (drawn, stored)]
    assert pictures[0].shape == pictures[1].shape == (1395, 1800, 3)
    # Another build of the font renderer may shade an edge otherwise; a bar or a word elsewhere would weigh far more.
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.2


def test_the_command_writes_the_same_bytes_in_every_process(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "webapp.explainer.pictures.granularity_figure", str(tmp_path / "figure.png")]
    subprocess.run(command, cwd=ROOT, check=True)
    written = (tmp_path / "figure.png").read_bytes()
    assert written == draw(LAYOUTS["simulation"])
    chunks, position = [], 8
    while position < len(written):
        (length,) = struct.unpack_from(">I", written, position)
        chunks.append(written[position + 4 : position + 8])
        position += 12 + length
    assert set(chunks) <= {b"IHDR", b"pHYs", b"IDAT", b"IEND"}, "no dates and no versions"


def test_every_row_tells_the_same_path() -> None:
    cells, rows = rows_of(LAYOUTS["simulation"])
    assert [row.granularity for row in rows] == ["steps", "events", "rooms"]
    assert [row.summary for row in rows] == [
        "20 steps, 308 states, r = 10",
        "9 steps, 14 states, r = 1",
        "4 steps, 5 states, r = 1",
    ]
    assert [row.spans[-1][1] for row in rows] == [len(cells) - 1] * 3
    assert rows[0].names[6] == "pickup"
    assert rows[1].names[1] == rows[2].names[0] == "take the key"


def test_cells_are_merged_where_the_granularity_does_not_tell_them_apart() -> None:
    _, (steps, events, rooms) = rows_of(LAYOUTS["simulation"])
    assert len(set(steps.zones.values())) == len(steps.zones)
    assert events.zones[1, 4] == events.zones[2, 5] != events.zones[3, 4]  # The last is beside the door.
    assert events.zones[2, 1] == events.zones[1, 2] != events.zones[3, 1]  # The first two are beside the key.
    assert rooms.zones[2, 1] == rooms.zones[3, 4] != rooms.zones[5, 4]


@pytest.mark.parametrize("arguments", [[], ["a", "b", "c"]])
def test_the_command_says_how_it_is_called(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert capsys.readouterr().err.startswith("usage: python -m")


def test_a_map_that_cannot_be_used_is_one_line_on_the_error_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "map.txt").write_text("####\n#>.#\n####\n", encoding="utf-8")
    assert main([str(tmp_path / "figure.png"), str(tmp_path / "map.txt")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert main([str(tmp_path / "figure.png"), str(tmp_path / "missing.txt")]) == 2
    assert not (tmp_path / "figure.png").exists()


def test_coarse_explanations_load_neither_matplotlib_nor_scipy_nor_torch() -> None:
    program = (
        "import sys; from webapp.explainer.pictures.granularity_figure import rows_of; "
        "from webapp.explainer.worlds.layout import parse_layout; "
        "rows_of(parse_layout('########\\n#>K.D.G#\\n########')); "
        "print({'matplotlib', 'scipy', 'torch', 'PIL'} & set(sys.modules))"
    )
    shown = subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    assert shown == "set()\n"
