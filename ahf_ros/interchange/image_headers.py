"""What image files say of themselves before they are decoded: size and orientation.

Formats: PNG 1.2, JPEG (ITU-T T.81), TIFF 6.0 and BigTIFF, Exif 2.3, BMP. Pillow 13 does not open
TIFF files of float64, and does not say where in a file the orientation is.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

UPRIGHT = 1
"""Orientation of an image whose first row is the upper one and whose first column is the left."""

_PNG = b'\x89PNG\r\n\x1a\n'
_WIDTH, _HEIGHT, _ORIENTATION = 256, 257, 274
_LAYOUTS = {1: 'B', 3: 'H', 4: 'L', 16: 'Q'}  # of integers, by the type of a TIFF field
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # JPEG markers with the size
_FIELDS = 4096  # of a directory, that are read at most


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """What an image file says of itself.

    Attributes
    ----------
    width, height : int
        Size, px; 0 where it is not known.
    orientation : int
        As in Exif, 1 to 8; `UPRIGHT` where the file does not say.
    orientation_at : tuple of (int, str) or None
        Place of the orientation in a TIFF file and its layout for `struct`.
    """

    width: int = 0
    height: int = 0
    orientation: int = UPRIGHT
    orientation_at: tuple[int, str] | None = None


def read_header(content: bytes) -> ImageHeader:
    """Return the header of an encoded image; of a format or file that is not known, an empty one.

    Parameters
    ----------
    content : bytes
        An image file.
    """
    with suppress(struct.error, ValueError):
        if content.startswith(_PNG):
            return _png(content)
        if content.startswith(b'\xff\xd8'):
            return _jpeg(content)
        if content[:4] in (b'II*\0', b'MM\0*', b'II+\0', b'MM\0+'):
            return _tiff(content, 0)
        if content.startswith(b'BM'):
            width, height = struct.unpack_from('<ii', content, 18)
            return ImageHeader(abs(width), abs(height))
    return ImageHeader()


def without_orientation(content: bytes, header: ImageHeader) -> bytes:
    """Return a TIFF file whose pixels are decoded as they are stored; others as they are.

    OpenCV applies the orientation of a TIFF file whatever its flags say.
    """
    if header.orientation_at is None or header.orientation == UPRIGHT:
        return content
    changed = bytearray(content)
    place, layout = header.orientation_at
    struct.pack_into(layout, changed, place, UPRIGHT)
    return bytes(changed)


def _png(content: bytes) -> ImageHeader:
    width, height = struct.unpack_from('>LL', content, 16)
    orientation = UPRIGHT
    place = len(_PNG)
    while place + 8 <= len(content):
        size, kind = struct.unpack_from('>L4s', content, place)
        if kind == b'eXIf':
            orientation = _exif(content, place + 8)
        if kind in (b'eXIf', b'IDAT', b'IEND'):
            break
        place += 12 + size
    return ImageHeader(width, height, orientation)


def _jpeg(content: bytes) -> ImageHeader:
    orientation = UPRIGHT
    place = 2
    while place + 4 <= len(content) and content[place] == 0xFF:
        marker = content[place + 1]
        if marker == 0xFF:  # fills up
            place += 1
            continue
        (size,) = struct.unpack_from('>H', content, place + 2)
        if marker in _FRAMES:
            height, width = struct.unpack_from('>HH', content, place + 5)
            return ImageHeader(width, height, orientation)
        if marker == 0xE1 and content[place + 4 : place + 10] == b'Exif\0\0':
            orientation = _exif(content, place + 10)
        place += 2 + size
    return ImageHeader(orientation=orientation)


def _exif(content: bytes, start: int) -> int:
    """Return the orientation in Exif data, which are a TIFF file without pixels."""
    with suppress(struct.error, ValueError):
        return _tiff(content, start).orientation
    return UPRIGHT


def _tiff(content: bytes, start: int) -> ImageHeader:
    found = {tag: (value, place) for tag, value, place in _fields(content, start)}
    width, height = (found.get(tag, (0, None))[0] for tag in (_WIDTH, _HEIGHT))
    orientation, place = found.get(_ORIENTATION, (UPRIGHT, None))
    return ImageHeader(width, height, orientation, place)


def _fields(content: bytes, start: int) -> Iterator[tuple[int, int, tuple[int, str]]]:
    """Yield tag, value and place of each field with one integer in the first directory."""
    order = '<' if content[start : start + 2] == b'II' else '>'
    big = content[start + 2 : start + 4] in (b'+\0', b'\0+')
    (offset,) = struct.unpack_from(
        order + ('Q' if big else 'L'), content, start + (8 if big else 4)
    )
    count_layout, field_layout = ('Q', 'HHQ') if big else ('H', 'HHL')
    (count,) = struct.unpack_from(order + count_layout, content, start + offset)
    place = start + offset + struct.calcsize(order + count_layout)
    for _ in range(min(count, _FIELDS)):
        tag, kind, values = struct.unpack_from(order + field_layout, content, place)
        value_at = place + struct.calcsize(order + field_layout)
        place = value_at + (8 if big else 4)
        if values == 1 and kind in _LAYOUTS:
            layout = order + _LAYOUTS[kind]
            (value,) = struct.unpack_from(layout, content, value_at)
            yield tag, value, (value_at, layout)
