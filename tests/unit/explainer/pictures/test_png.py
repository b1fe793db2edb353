import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from webapp.explainer.pictures.png import compress, stack

GREYS = bytes(part for shade in range(256) for part in (shade, shade, shade))
Indices = NDArray[np.uint8]


def banded(rows: Indices) -> Image.Image:
    image = Image.frombytes("P", (rows.shape[1], rows.shape[0]), rows.tobytes())
    image.putpalette(GREYS)
    return image


def stacked(*bands: Indices, palette: bytes = GREYS) -> bytes:
    return stack([compress(banded(rows)) for rows in bands], palette)


def chunks(png: bytes) -> list[tuple[bytes, bytes]]:
    """Take a PNG apart by its specification, and check every chunk's check sum."""
    assert png[:8] == bytes((137, 80, 78, 71, 13, 10, 26, 10))
    found, at = [], 8
    while at < len(png):
        (length,) = struct.unpack_from(">I", png, at)
        kind, data = png[at + 4 : at + 8], png[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", png, at + 8 + length) == (zlib.crc32(kind + data),)
        found.append((kind, data))
        at += 12 + length
    return found


@st.composite
def stacks(draw: st.DrawFn) -> list[Indices]:
    """Draw bands of one width: noise, so that every byte counts, or one colour, which compresses most."""
    width = draw(st.integers(1, 300))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shapes = [(height, width) for height in draw(st.lists(st.integers(1, 90), min_size=1, max_size=4))]
    colours = draw(st.sampled_from([1, 2, 256]))
    return [np.asarray(256 - colours + rng.integers(colours, size=shape), dtype=np.uint8) for shape in shapes]


@given(stacks())
def test_a_stack_shows_its_bands_one_below_the_other(bands: list[Indices]) -> None:
    image = Image.open(BytesIO(stacked(*bands)))
    assert (image.format, image.mode, image.info) == ("PNG", "P", {})
    assert np.array_equal(np.asarray(image), np.concatenate(bands))


@given(stacks())
def test_a_strict_reader_finds_one_whole_stream_and_its_check_sum(bands: list[Indices]) -> None:
    found = chunks(stacked(*bands))
    assert [kind for kind, _ in found] == [b"IHDR", b"PLTE", b"IDAT", b"IEND"]
    reader = zlib.decompressobj()
    lines = reader.decompress(found[2][1])  # Raises if the Adler-32 is wrong.
    assert reader.eof
    assert reader.unused_data == b""
    assert lines == b"".join(b"\x00" + row.tobytes() for band in bands for row in band)


def test_bands_compressed_apart_take_no_more_room_than_one_compressed_whole() -> None:
    rng = np.random.default_rng(0)
    bands = [np.repeat(rng.integers(256, size=(96, 288), dtype=np.uint8), 2, axis=0) for _ in range(3)]
    assert len(stacked(*bands)) < 1.01 * len(stacked(np.concatenate(bands)))


def test_bands_of_several_widths_are_refused() -> None:
    bands = [np.zeros((2, width), dtype=np.uint8) for width in (3, 4)]
    with pytest.raises(ValueError, match=r"bands of one width, not of \[3, 4\]"):
        stacked(*bands)


def test_a_stack_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match=r"bands of one width, not of \[\]"):
        stack([], GREYS)


@pytest.mark.parametrize("size", [0, 4, 771])
def test_a_palette_that_is_no_palette_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=f"1 to 256 colours of three bytes each, not {size} bytes"):
        stacked(np.zeros((2, 2), dtype=np.uint8), palette=bytes(size))


def test_rows_without_a_palette_are_refused() -> None:
    with pytest.raises(ValueError, match="mode 'P', not 'RGB'"):
        compress(Image.new("RGB", (3, 3)))
