import io
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from tests.worlds import LAYOUTS
from webapp.explainer.comparison import SELECTORS, Comparison, ComparisonSettings, compare
from webapp.explainer.pictures.comparison_picture import write_picture
from webapp.explainer.solvers import follow, plan
from webapp.explainer.worlds.key_door import tabulate

VERMILION, BLUE = (0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2)


@cache
def comparison() -> Comparison:
    mdp = tabulate(LAYOUTS["simulation"])
    policy = plan(mdp)
    found = compare(mdp, policy, follow(mdp, policy), ComparisonSettings(num_draws=3))
    return replace(found, ratings=tuple(replace(rating, seconds=0.0) for rating in found.ratings))


def written(path: Path, what: Comparison | None = None) -> bytes:
    write_picture(what or comparison(), path)
    return path.read_bytes()


def texts(svg: bytes) -> list[str]:
    """Return what the letters spell, which matplotlib notes above their outlines."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314 - our own file.
    tree = ET.fromstring(svg, parser)  # noqa: S314 - our own file.
    return [str(node.text).strip() for node in tree.iter() if callable(node.tag)]


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_same_comparison_gives_the_same_bytes_and_another_does_not(tmp_path: Path, suffix: str) -> None:
    first, again = written(tmp_path / f"a{suffix}"), written(tmp_path / f"b{suffix}")
    other = written(tmp_path / f"c{suffix}", replace(comparison(), alpha=0.7))
    assert first == again != other


def test_the_picture_names_every_selector_and_its_smallest_k(tmp_path: Path) -> None:
    words = texts(written(tmp_path / "a.svg"))
    for rating in comparison().ratings:
        assert words.count(rating.selector) == 2
    marked = [word for word in words if word.startswith("k = ")]
    assert marked == [f"k = {rating.smallest}" for rating in comparison().ratings]
    assert {"alpha = 0.5", "smallest k above 0.5", "probability of the goal within 40 actions"} <= set(words)


def test_where_nothing_exceeds_alpha_the_picture_says_none(tmp_path: Path) -> None:
    low = replace(
        comparison(),
        alpha=0.2,
        ratings=tuple(
            replace(rating, smallest=None, curve=tuple(replace(each, value=each.value / 10) for each in rating.curve))
            for rating in comparison().ratings
        ),
    )
    words = texts(written(tmp_path / "a.svg", low))
    assert words.count("none") == len(SELECTORS)
    assert not any(word.startswith("k = ") for word in words)
    assert "1" not in words  # The axis ends at alpha, or all curves would lie on the floor.


def test_the_papers_curve_is_vermilion_and_the_rivals_are_blue(tmp_path: Path) -> None:
    image = Image.open(io.BytesIO(written(tmp_path / "a.png"))).convert("RGB")
    pixels = np.asarray(image)
    assert image.size == (1480, 840)
    left, right = pixels[:400, :455], pixels[:400, 500:1090]
    for colour, here, elsewhere in ((VERMILION, left, right), (BLUE, right, left)):
        assert (here == colour).all(axis=2).any()
        assert not (elsewhere == colour).all(axis=2).any()


def test_a_file_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_text("precious")
    with pytest.raises(ValueError, match=r"a\.png' exists already; remove it or choose another name"):
        write_picture(comparison(), path)
    assert path.read_text() == "precious"


@pytest.mark.parametrize("name", ["a.pdf", "a", "png"])
def test_another_kind_of_file_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=rf"a picture is a \.png or \.svg file, and '.*{name}' is neither"):
        write_picture(comparison(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"there is no folder .*nowhere. for the picture; make it first"):
        write_picture(comparison(), tmp_path / "nowhere" / "a.svg")


def test_a_comparison_without_a_picture_loads_no_matplotlib() -> None:
    code = (
        "import sys, webapp.explainer.comparison, webapp.explainer.pictures.comparison_picture;"
        "print([name for name in ('matplotlib', 'scipy', 'torch') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
