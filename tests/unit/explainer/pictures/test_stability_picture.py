import subprocess
import sys
from collections.abc import Callable
from functools import cache
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

from tests.unit.explainer.test_tie_breaking import open_floor
from tests.worlds import LAYOUTS
from webapp.explainer.mdp import DeterministicMDP
from webapp.explainer.pictures.stability_picture import draw_stability, write_picture
from webapp.explainer.solvers import follow, plan
from webapp.explainer.stability import Stability, stability
from webapp.explainer.variants import OtherAgent, StabilitySettings
from webapp.explainer.worlds.key_door import tabulate


def of(mdp: DeterministicMDP, asked: StabilitySettings, num_agents: int = 0) -> Stability:
    agents = [OtherAgent(f"training seed {seed}", mdp, plan(mdp)) for seed in range(num_agents)]
    return stability(mdp, plan(mdp), follow(mdp, plan(mdp)), asked, agents=agents)


@cache
def found() -> Stability:
    asked = StabilitySettings(random_step_counts=(5, 40), num_tie_breaks=5, importances=("ace",))
    return of(tabulate(LAYOUTS["experiment1-a"]), asked, num_agents=3)


@cache
def long_path() -> Stability:
    asked = StabilitySettings(random_step_counts=(5,), num_tie_breaks=0)
    return of(open_floor(40), asked)


@cache
def short_path() -> Stability:
    return of(open_floor(2), StabilitySettings(num_tie_breaks=1))


@cache
def nothing_tried() -> Stability:
    return of(open_floor(3), StabilitySettings(random_step_counts=(), rules=(), num_tie_breaks=0))


@cache
def long_words() -> Stability:
    asked = StabilitySettings(importance="ace", rule="largest-gap", num_tie_breaks=1, random_step_counts=())
    return of(open_floor(3), asked)


EVERY_SHAPE = [found, long_words, long_path, short_path, nothing_tried]


def axes_of(drawn: Stability) -> tuple[Axes, Axes]:
    shares, matrix = draw_stability(drawn, "a map").axes
    return shares, matrix


def test_a_bar_is_as_high_as_the_share_and_hatched_where_the_step_flips() -> None:
    shares, _ = axes_of(found())
    bars = [patch for patch in shares.patches if isinstance(patch, Rectangle)]
    assert len(bars) == len(found().steps)
    for bar, step in zip(bars, found().steps, strict=True):
        assert bar.get_x() + bar.get_width() / 2 == pytest.approx(step.step)
        assert bar.get_height() == pytest.approx(step.overall.share)
        assert bool(bar.get_hatch()) == bool(step.flips)


def test_a_cell_is_the_darker_the_more_ways_and_none_is_white() -> None:
    _, matrix = axes_of(found())
    meshes = [each for each in matrix.collections if isinstance(each, QuadMesh)]
    drawn = np.concatenate([np.asarray(mesh.get_array()) for mesh in meshes])
    shares = np.array([[count.share for count in step.by_level] for step in found().steps]).T
    assert drawn.shape == shares.shape
    np.testing.assert_array_equal(drawn == 0, shares == 0)
    np.testing.assert_array_equal(
        np.argsort(drawn, axis=None, kind="stable"), np.argsort(shares, axis=None, kind="stable")
    )
    colours = meshes[0].cmap(np.linspace(0, 1, 50))[:, :3]
    assert np.all(np.diff(colours @ [0.299, 0.587, 0.114]) <= 0)
    assert tuple(colours[0]) == (1, 1, 1)


def test_every_share_but_none_is_written_into_its_cell() -> None:
    _, matrix = axes_of(found())
    written = [text for text in matrix.texts if text.get_text()]
    assert len(written) == sum(count.count > 0 for step in found().steps for count in step.by_level)


def test_rows_and_columns_are_named_and_what_is_explained_stands_out() -> None:
    _, matrix = axes_of(found())
    rows = {label.get_text(): label.get_fontweight() for label in matrix.get_yticklabels()}
    assert [name for name, weight in rows.items() if weight == "bold"] == [
        "return probability",
        "r = 10",
        "threshold: mean",
    ]
    assert {"average causal effect", "r = 40", "threshold: top-3", "5 random tie-breakings", "training seed 2"} <= set(
        rows
    )
    columns = {label.get_text(): label.get_fontweight() for label in matrix.get_xticklabels()}
    assert list(columns) == [f"{step.step}  {step.action}" for step in found().steps]
    bold = [int(name.split()[0]) for name, weight in columns.items() if weight == "bold"]
    assert tuple(bold) == found().subgoals


def test_a_frame_runs_around_each_subgoal_of_the_explanation() -> None:
    _, matrix = axes_of(found())
    frames = [patch for patch in matrix.patches if isinstance(patch, Rectangle)]
    num_groups = len({level.factor for level in found().levels})
    middles = sorted(frame.get_x() + 0.5 for frame in frames)
    assert middles == sorted(step for step in found().subgoals for _ in range(num_groups))


@pytest.mark.parametrize("shape", EVERY_SHAPE)
def test_no_words_lie_on_others_or_leave_the_picture(shape: Callable[[], Stability]) -> None:
    figure = draw_stability(shape(), "a map with a name as long as those of files that lie deep in many folders/" * 2)
    figure.canvas.draw()
    shares, matrix = figure.axes
    words: list[Text] = [shares.yaxis.label, matrix.xaxis.label, *matrix.texts]
    words += [*shares.get_yticklabels(), *matrix.get_yticklabels()]
    first, last = matrix.get_xlim()
    ticks = zip(matrix.get_xticks(), matrix.get_xticklabels(), strict=True)
    words += [label for place, label in ticks if first <= place <= last]
    (legend,) = figure.legends
    words += [*legend.get_texts(), legend.get_title(), *figure.texts]
    boxes = [word.get_window_extent() for word in words if word.get_text()]
    assert any("Subgoals in" in word.get_text() for word in words)
    edge = figure.bbox
    for box in boxes:
        assert box.x0 >= edge.x0 - 1
        assert box.x1 <= edge.x1 + 1
        assert box.y0 >= edge.y0 - 1
        assert box.y1 <= edge.y1 + 1
    for one, other in combinations(boxes, 2):
        shared = Bbox.intersection(one, other)
        assert shared is None or min(shared.width, shared.height) < 1


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_same_stability_gives_the_same_bytes_whatever_style_the_caller_has_set(tmp_path: Path, suffix: str) -> None:
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    write_picture(found(), first, "a map")
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "svg.hashsalt": None, "savefig.dpi": 30}):
        write_picture(found(), second, "a map")
        assert mpl.rcParams["font.size"] == 20
    assert first.read_bytes() == second.read_bytes()
    other = tmp_path / f"other{suffix}"
    write_picture(short_path(), other, "a map")
    assert other.read_bytes() != first.read_bytes()


@pytest.mark.parametrize("shape", EVERY_SHAPE)
def test_a_png_is_wide_enough_for_print_and_its_edges_are_free(tmp_path: Path, shape: Callable[[], Stability]) -> None:
    path = tmp_path / "picture.png"
    write_picture(shape(), path)
    with Image.open(path) as picture:
        assert picture.format == "PNG"
        assert picture.width >= 1600
        assert not picture.info.get("Software")
        grey = np.asarray(picture.convert("L"))
    assert grey[:2].min() == grey[-2:].min() == 255
    assert grey.min() < 60


def test_an_svg_names_no_date(tmp_path: Path) -> None:
    path = tmp_path / "picture.svg"
    write_picture(short_path(), path)
    text = path.read_text(encoding="utf-8")
    assert "<svg" in text
    assert "<dc:date>" not in text


@pytest.mark.parametrize("name", ["picture.pdf", "picture", "picture.jpeg"])
def test_another_suffix_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=rf"a picture is a \.png or \.svg file, and '.*{name}' is neither"):
        write_picture(short_path(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_exists_is_kept_unless_it_may_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / "picture.PNG"
    path.write_text("somebody's", encoding="utf-8")
    with pytest.raises(ValueError, match=r"picture\.PNG' exists already; remove it or choose another name"):
        write_picture(short_path(), path)
    assert path.read_text(encoding="utf-8") == "somebody's"


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"there is no folder '.*nowhere' for the picture"):
        write_picture(short_path(), tmp_path / "nowhere" / "picture.png")


def test_matplotlib_is_loaded_only_to_draw() -> None:
    code = "import sys, webapp.explainer.pictures.stability_picture; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
