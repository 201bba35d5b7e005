"""Size and orientation of an image file, read before anything is decoded.

PNG 1.2, JPEG (ITU-T T.81), TIFF 6.0, BigTIFF, WebP and BMP with Exif 2.3 are known: OpenCV alone
takes 1.1 GB for a PNG file of 0.5 MB. Pillow, one more dependency, opens neither TIFF files of
float64 nor colour ones of float32, and does not say where in a file the orientation is.
"""

import math
import re
import struct
from contextlib import suppress
from dataclasses import dataclass

from ahf_ros.files.png import is_png, png_chunks
from ahf_ros.files.tiff import Field, directories, first_at, first_directory, is_tiff

UPRIGHT = 1
"""Orientation of an image whose first row is the upper one and whose first column is the left."""

_SUBFILE, _WIDTH, _HEIGHT, _COLOURS, _ORIENTATION = 254, 256, 257, 262, 274  # tags of TIFF
_REDUCED = 1 | 4  # bits of the first: a reduced image, a mask
_RAW = 32803, 34892  # colours: as the filter of the sensor, and linear raw
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # JPEG markers with the size
_DAMAGES = struct.error, ValueError, OverflowError  # of headers


HEIC = 'HEIC'
"""A kind of images that an extra reads."""

_OTHERS = tuple(
    (kind, re.compile(begin, re.DOTALL))
    for kind, begin in (
        (HEIC, rb'....ftyp(hei|hev|mif1|msf1)'),
        ('AVIF', rb'....ftypavi'),
        ('JPEG XL', rb'\xff\x0a|\0\0\0\x0cJXL '),
        ('JPEG 2000', rb'\0\0\0\x0cjP  |\xff\x4f\xff\x51'),
        ('a raw image', rb'....ftypcrx |FUJIFILMCCD-RAW|IIR[OS]|MMOR|IIU\0|FOVb'),
    )
)
"""Formats of cameras that OpenCV may not know, by the bytes that they begin with."""


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """What an image file says of itself.

    A width or height of 0 px is not known. `orientation` is as in Exif, 1 to 8. A TIFF file has
    `pages`, and may be `raw`, what a sensor saw before colours were made of it. The `kind` is one
    of the formats that OpenCV may not know, empty for others. With `changes`, each a place, a
    layout for `struct` and a value, decoders take the image of full size as it is stored.
    """

    width: int = 0
    height: int = 0
    orientation: int = UPRIGHT
    pages: int = 1
    raw: bool = False
    kind: str = ''
    changes: tuple[tuple[int, str, int], ...] = ()


def read_header(content: bytes) -> ImageHeader:
    """Return the header of an image file; of a format or file that is not known, an empty one."""
    with suppress(*_DAMAGES):
        if is_png(content):
            return _png(content)
        if content.startswith(b'\xff\xd8'):
            return _jpeg(content)
        if is_tiff(content):
            return _tiff(content)
        if content[:4] == b'RIFF' and content[8:12] == b'WEBP':
            return _webp(content)
        if content.startswith(b'BM'):
            width, height = struct.unpack_from('<ii', content, 18)
            return ImageHeader(abs(width), abs(height))
    kind = next((kind for kind, begin in _OTHERS if begin.match(content)), '')
    return ImageHeader(kind=kind)


def _png(content: bytes) -> ImageHeader:
    width, height = struct.unpack_from('>LL', content, 16)
    orientation = UPRIGHT
    with suppress(struct.error):
        for kind, place, size in png_chunks(content):
            if kind == b'eXIf':
                orientation = _exif(content[place : place + size])
            if kind in (b'eXIf', b'IDAT'):
                break
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
            orientation = _exif(content[place + 10 : place + 2 + size])
        place += 2 + size
    return ImageHeader(orientation=orientation)


def _webp(content: bytes) -> ImageHeader:
    """Return the header of an extended WebP file; others have no orientation."""
    width = height = 0
    orientation = UPRIGHT
    place = 12
    while place + 8 <= len(content):
        kind, size = struct.unpack_from('<4sL', content, place)
        place += 8
        if kind == b'VP8X':
            sides = content[place + 4 : place + 7], content[place + 7 : place + 10]
            width, height = (int.from_bytes(it, 'little') + 1 for it in sides)
        if kind == b'EXIF':
            orientation = _exif(content[place : place + size].removeprefix(b'Exif\0\0'))
        place += size + size % 2
    return ImageHeader(width, height, orientation)


def _exif(content: bytes) -> int:
    """Return the orientation in Exif data, which are a TIFF file without pixels."""
    with suppress(*_DAMAGES):
        return _value(content, first_directory(content), _ORIENTATION, UPRIGHT)
    return UPRIGHT


def _tiff(content: bytes) -> ImageHeader:
    """Return the header of the largest image that is not marked as a reduced one."""
    found = directories(content)
    first, *_ = found

    def sides(place: int) -> list[int]:
        return [_value(content, found[place], tag, 0) for tag in (_WIDTH, _HEIGHT)]

    whole = [it for it in found if not _value(content, found[it], _SUBFILE, 0) & _REDUCED]
    chosen = max(whole or found, key=lambda it: math.prod(sides(it)))
    fields = found[chosen]
    changes = []
    if chosen != first:
        changes.append((*first_at(content), chosen))
    if _ORIENTATION in fields:  # OpenCV applies it in a TIFF file whatever its flags say
        changes.append((fields[_ORIENTATION].place, fields[_ORIENTATION].layout, UPRIGHT))
    of_file = _value(content, found[first], _ORIENTATION, UPRIGHT)
    return ImageHeader(
        width=sides(chosen)[0],
        height=sides(chosen)[1],
        orientation=_value(content, fields, _ORIENTATION, of_file),
        pages=sum(sides(it) == sides(chosen) for it in whole),
        raw=_value(content, fields, _COLOURS, 0) in _RAW or content[8:10] == b'CR',
        changes=tuple(changes),
    )


def _value(content: bytes, fields: dict[int, Field], tag: int, default: int) -> int:
    """Return what a field with one integer says."""
    if tag not in fields or fields[tag].count != 1:
        return default
    return int(fields[tag].values(content)[0])
