"""The camera and the focal length that an image file notes in its Exif data (CIPA DC-008)."""

from __future__ import annotations

import math
import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ahf_ros.interchange.files import is_url, read_bytes
from ahf_ros.interchange.image_files import read_header

FILM_DIAGONAL = math.hypot(36, 24)
"""Diagonal of a film frame, mm, which equivalent focal lengths refer to (CIPA DCG-001)."""

_MAKE, _MODEL, _MORE = 271, 272, 34665  # tags; the last one points to the directory of the others
_FOCAL_LENGTH, _RESOLUTION, _RESOLUTION_UNIT = 37386, 41486, 41488
_WIDTH, _EQUIVALENT, _SERIAL_NUMBER = 40962, 41989, 42033
_LAYOUTS = {2: 's', 3: 'H', 4: 'L', 5: 'LL'}  # of values, by the type of a field
_UNITS = {2: 25.4, 3: 10.0, 4: 1.0}  # mm, of resolutions
_LEAST, _MOST = 0.2, 50.0  # focal lengths that are believed, in diagonals of the image
_FIELDS = 1024  # of a directory, that are read at most
_BEGINNING = 2**20  # bytes of a file, which Exif data of photographs do not exceed


@dataclass(frozen=True, slots=True)
class Exif:
    """What a photograph says of its camera: name, serial number and focal length in mm.

    `focal_length` is 0 where it is not known, `pixels` is the same length in px, None if unknown.
    """

    camera: str = ''
    serial_number: str = ''
    focal_length: float = 0.0
    pixels: float | None = None


def read_exif(path: str | Path) -> tuple[Exif, tuple[int, int]]:
    """Return the Exif data of an image file, empty where there are none, and width and height.

    These are 0 px where the format is not known. A ValueError names a file that cannot be read.
    """
    header = read_header(read_bytes(path) if is_url(str(path)) else _beginning(Path(path)))
    size = header.width, header.height
    fields = exif_fields(header.exif)
    length = fields.get(_FOCAL_LENGTH, 0.0)
    name = f'{fields.get(_MAKE, "")} {fields.get(_MODEL, "")}'.strip()
    pixels = _pixels(fields, *size) if all(size) else None
    return Exif(name, fields.get(_SERIAL_NUMBER, ''), length, pixels), size


def equivalent_in_px(millimetres: float, width: int, height: int) -> float:
    """Return the focal length in px of one that is equivalent on film, by the diagonal."""
    return millimetres * math.hypot(width, height) / FILM_DIAGONAL


def exif_fields(content: bytes) -> dict[int, Any]:
    """Return texts and numbers of Exif data by their tags; fields that are damaged are absent."""
    fields: dict[int, Any] = {}
    with suppress(struct.error):
        order = '<' if content[:2] == b'II' else '>'
        (start,) = struct.unpack_from(f'{order}L', content, 4)
        fields |= _directory(content, order, start)
        if isinstance(fields.get(_MORE), int):
            fields |= _directory(content, order, fields[_MORE])
    return fields


def _beginning(path: Path) -> bytes:
    try:
        with path.open('rb') as file:
            return file.read(_BEGINNING)
    except OSError as error:
        raise ValueError(f'{path} cannot be read: {error.strerror}') from error


def _directory(content: bytes, order: str, start: int) -> dict[int, Any]:
    fields: dict[int, Any] = {}
    (count,) = struct.unpack_from(f'{order}H', content, start)
    for number in range(min(count, _FIELDS)):
        place = start + 2 + 12 * number
        with suppress(struct.error, ZeroDivisionError):
            tag, kind, values = struct.unpack_from(f'{order}HHL', content, place)
            if kind not in _LAYOUTS or (kind != 2 and values != 1) or values > len(content):
                continue
            layout = f'{order}{values}s' if kind == 2 else order + _LAYOUTS[kind]
            place += 8
            if struct.calcsize(layout) > 4:
                (place,) = struct.unpack_from(f'{order}L', content, place)
            found = struct.unpack_from(layout, content, place)
            if kind == 2:
                text = found[0].split(b'\0')[0].decode('utf-8', 'replace')
                fields[tag] = ''.join(it for it in text if it.isprintable()).strip()
            else:
                fields[tag] = found[0] / found[1] if kind == 5 else found[0]
    return fields


def _pixels(fields: dict[int, Any], width: int, height: int) -> float | None:
    """Return the focal length in px, from the pitch of the pixels or the equivalent on film."""
    lengths = [
        fields.get(_FOCAL_LENGTH, 0.0)
        * fields.get(_RESOLUTION, 0.0)
        / _UNITS.get(fields.get(_RESOLUTION_UNIT, 0), math.inf)
        * (max(width, height) / (fields.get(_WIDTH) or max(width, height))),
        equivalent_in_px(fields.get(_EQUIVALENT, 0), width, height),
    ]
    diagonal = math.hypot(width, height)
    return next((it for it in lengths if _LEAST < it / diagonal < _MOST), None)
