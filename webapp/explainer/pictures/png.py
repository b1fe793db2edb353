"""PNG files stacked from bands of rows, each band compressed once, however many files show it.

What a PNG says of its pixels is one deflate stream in a zlib wrapper (W3C, Portable Network Graphics, 3rd edition,
section 10). Deflate's blocks refer to earlier bytes only if the compressor chose to (RFC 1951), so streams that were
compressed apart and end on a whole byte can follow each other, and their check sums add up (RFC 1950). This costs few
bytes where a band is larger than the 32 KiB that deflate looks back.
"""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

from PIL import Image

_COMPRESSION = 8
"""zlib's level: 9 takes twice the time and saves a fiftieth."""

_MAX_COLOURS = 256
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_BIT_DEPTH, _INDEXED = 8, 3
"""A byte per pixel, which is the number of a colour in the palette."""

_ZLIB_HEADER = b"\x78\xda"
"""A window of 32 KiB, compressed well."""

_LAST_BLOCK = b"\x03\x00"
"""A last deflate block with nothing in it."""

_ADLER = 65521
"""The modulus of Adler-32."""


@dataclass(frozen=True, slots=True)
class Band:
    """Some rows of a picture, compressed.

    Attributes:
        width: Pixels of a row.
        height: The number of rows.
        deflated: Deflate blocks that end on a whole byte, of which none is a stream's last.
        checksum: The Adler-32 of what was compressed.
    """

    width: int
    height: int
    deflated: bytes
    checksum: int

    @property
    def num_bytes(self) -> int:
        """The number of bytes that were compressed: a byte per pixel, and one before each row."""
        return self.height * (self.width + 1)


def compress(rows: Image.Image) -> Band:
    """Compress some rows of a picture with a palette.

    Raises:
        ValueError: The picture has no palette.
    """
    if rows.mode != "P":
        raise ValueError(f"a band has a palette, mode 'P', not {rows.mode!r}")
    # The column of zeros before the pixels says of each row that it is not filtered, which suits palettes.
    lines = Image.new("P", (rows.width + 1, rows.height))
    lines.paste(rows, (1, 0))
    content = lines.tobytes()
    compressor = zlib.compressobj(_COMPRESSION, wbits=-zlib.MAX_WBITS)
    deflated = compressor.compress(content) + compressor.flush(zlib.Z_FULL_FLUSH)
    return Band(rows.width, rows.height, deflated, zlib.adler32(content))


def stack(bands: Sequence[Band], palette: bytes) -> bytes:
    """Return a PNG without metadata that shows bands one below the other.

    Args:
        bands: From the top down, equally wide.
        palette: Red, green and blue of each colour, 0 to 255.

    Raises:
        ValueError: There are no bands, they differ in width, or the palette does not hold 1 to 256 whole colours.
    """
    widths = {band.width for band in bands}
    if len(widths) != 1:
        raise ValueError(f"a picture needs bands of one width, not of {sorted(widths)}")
    if not palette or len(palette) % 3 or len(palette) > 3 * _MAX_COLOURS:
        raise ValueError(f"a palette holds 1 to {_MAX_COLOURS} colours of three bytes each, not {len(palette)} bytes")
    height = sum(band.height for band in bands)
    header = struct.pack(">IIBBBBB", *widths, height, _BIT_DEPTH, _INDEXED, 0, 0, 0)
    checksum = struct.pack(">I", _checksum(bands))
    content = b"".join(chain([_ZLIB_HEADER], (band.deflated for band in bands), [_LAST_BLOCK, checksum]))
    chunks = ((b"IHDR", header), (b"PLTE", palette), (b"IDAT", content), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(kind, data) for kind, data in chunks)


def _checksum(bands: Sequence[Band]) -> int:
    """Return the Adler-32 of what all bands hold, from the check sums of each.

    Its low half is 1 plus the sum of the bytes, its high half the sum of the low halves after each byte (RFC 1950).
    """
    low, high = 1, 0
    for band in bands:
        high = (high + (band.checksum >> 16) + band.num_bytes * (low - 1)) % _ADLER
        low = (low + (band.checksum & 0xFFFF) - 1) % _ADLER
    return high << 16 | low


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))
