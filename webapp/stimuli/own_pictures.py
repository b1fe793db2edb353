"""The pictures of a study's own worlds: whatever was drawn, as square PNGs that are sharp enough for a page."""

import hashlib
import io
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

SMALLEST_EDGE = 288
"""Smaller pictures are enlarged by a whole factor, so that their pixels stay squares."""

LARGEST_EDGE = 1152
"""Larger pictures are reduced to this many pixels each way."""

_MARGIN = (255, 255, 255)
"""The colour beside a picture that is not square."""

_MOST_COLOURS = 256


def as_picture(drawn: Any) -> bytes:  # noqa: ANN401 - whatever a researcher's code gives.
    """Make a picture for pages of what was drawn; equal drawings give equal bytes.

    Args:
        drawn: The bytes of a PNG, or an array `[height, width, 3]` (or 4, with opacity) of whole numbers 0 to 255.

    Returns:
        A square PNG without metadata.

    Raises:
        ValueError: It is neither.
    """
    image = _fitted(_squared(_image(drawn)))
    few = image.getcolors(_MOST_COLOURS)
    if few is not None:
        image = image.quantize(len(few), dither=Image.Dither.NONE)
    file = io.BytesIO()
    image.save(file, format="PNG", optimize=True)
    return file.getvalue()


def digest_of(drawn: Any) -> str:  # noqa: ANN401 - as for `as_picture`.
    """Return what tells drawings apart without making pictures of them."""
    if isinstance(drawn, bytes):
        return hashlib.sha256(drawn).hexdigest()
    array = np.asarray(drawn)
    return hashlib.sha256(repr((array.shape, array.dtype.str)).encode() + array.tobytes()).hexdigest()


def _image(drawn: Any) -> Image.Image:  # noqa: ANN401 - as for `as_picture`.
    wish = "give the bytes of a PNG, or an array [height, width, 3] of whole numbers from 0 to 255"
    if isinstance(drawn, bytes):
        try:
            return _opaque(Image.open(io.BytesIO(drawn), formats=["PNG"]))
        except (UnidentifiedImageError, OSError, SyntaxError) as problem:
            raise ValueError(f"{len(drawn)} bytes are no PNG ({problem}); {wish}") from None
    array = np.asarray(drawn)
    if array.ndim != 3 or array.shape[2] not in (3, 4) or 0 in array.shape:  # noqa: PLR2004 - colours, perhaps opacity.
        raise ValueError(f"a {type(drawn).__name__} of shape {array.shape} is no picture; {wish}")
    if not np.issubdtype(array.dtype, np.integer) or array.min() < 0 or array.max() > 255:  # noqa: PLR2004 - as said.
        raise ValueError(f"an array of {array.dtype} from {array.min()} to {array.max()} is no picture; {wish}")
    return _opaque(Image.fromarray(np.ascontiguousarray(array.astype(np.uint8))))


def _opaque(image: Image.Image) -> Image.Image:
    if "A" not in image.getbands() and "transparency" not in image.info:
        return image.convert("RGB")
    behind = Image.new("RGBA", image.size, (*_MARGIN, 255))
    return Image.alpha_composite(behind, image.convert("RGBA")).convert("RGB")


def _squared(image: Image.Image) -> Image.Image:
    edge = max(image.size)
    if image.size == (edge, edge):
        return image
    square = Image.new("RGB", (edge, edge), _MARGIN)
    square.paste(image, ((edge - image.width) // 2, (edge - image.height) // 2))
    return square


def _fitted(image: Image.Image) -> Image.Image:
    edge = image.width
    if edge < SMALLEST_EDGE:
        edge *= -(-SMALLEST_EDGE // edge)
        return image.resize((edge, edge), Image.Resampling.NEAREST)
    if edge > LARGEST_EDGE:
        return image.resize((LARGEST_EDGE, LARGEST_EDGE), Image.Resampling.LANCZOS)
    return image
