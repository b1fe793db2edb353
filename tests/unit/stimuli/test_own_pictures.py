"""Whatever a researcher's code draws becomes a square picture, or is refused."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from webapp.stimuli.own_pictures import LARGEST_EDGE, SMALLEST_EDGE, as_picture, digest_of

SEED = st.integers(0, 2**32 - 1)


def opened(png: bytes) -> Image.Image:
    image = Image.open(io.BytesIO(png), formats=["PNG"])
    assert image.info.keys() <= {"transparency"}
    return image.convert("RGB")


@given(height=st.integers(1, 12), width=st.integers(1, 12), seed=SEED)
def test_a_small_picture_keeps_its_pixels_as_squares_on_white(height: int, width: int, seed: int) -> None:
    drawn = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    shown = np.asarray(opened(as_picture(drawn)))
    edge = max(height, width)
    factor = -(-SMALLEST_EDGE // edge)
    assert shown.shape == (edge * factor, edge * factor, 3)
    small = shown[::factor, ::factor]
    assert np.array_equal(np.kron(small, np.ones((factor, factor, 1), dtype=np.uint8)), shown)
    top, left = (edge - height) // 2, (edge - width) // 2
    assert np.array_equal(small[top : top + height, left : left + width], drawn)
    small = small.copy()
    small[top : top + height, left : left + width] = 255
    assert (small == 255).all()


def test_a_large_picture_is_reduced() -> None:
    drawn = np.zeros((LARGEST_EDGE + 7, LARGEST_EDGE + 7, 3), dtype=np.uint8)
    assert opened(as_picture(drawn)).size == (LARGEST_EDGE, LARGEST_EDGE)


def test_a_png_and_the_array_of_its_pixels_give_the_same_picture() -> None:
    drawn = np.random.default_rng(1).integers(0, 256, (20, 30, 3))
    file = io.BytesIO()
    Image.fromarray(drawn.astype(np.uint8)).save(file, format="PNG")
    assert as_picture(file.getvalue()) == as_picture(drawn)


def test_what_can_be_seen_through_is_white() -> None:
    drawn = np.zeros((1, 1, 4), dtype=np.uint8)
    assert np.asarray(opened(as_picture(drawn))).min() == 255


def test_drawings_are_told_apart_by_pixels_and_shape() -> None:
    drawn = np.zeros((2, 3, 3), dtype=np.uint8)
    other = drawn.copy()
    other[1, 1, 1] = 1
    assert digest_of(drawn) == digest_of(drawn.copy())
    assert len({digest_of(each) for each in (drawn, other, drawn.reshape(3, 2, 3), drawn.tobytes())}) == 4


@pytest.mark.parametrize(
    ("drawn", "told"),
    [
        (None, r"a NoneType of shape \(\) is no picture"),
        (np.zeros((3, 3)), r"a ndarray of shape \(3, 3\) is no picture"),
        (np.zeros((0, 3, 3), dtype=np.uint8), r"a ndarray of shape \(0, 3, 3\) is no picture"),
        (np.zeros((3, 3, 3)), "an array of float64 from 0.0 to 0.0 is no picture"),
        (np.full((3, 3, 3), 256), "an array of int64 from 256 to 256 is no picture"),
        (b"GIF89a", "6 bytes are no PNG"),
    ],
)
def test_what_is_no_picture_is_refused(drawn: object, told: str) -> None:
    with pytest.raises(ValueError, match=f"{told}.*; give the bytes of a PNG, or an array"):
        as_picture(drawn)
