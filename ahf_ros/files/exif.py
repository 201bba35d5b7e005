"""The camera and the focal length that an image file notes in its Exif data (CIPA DC-008)."""

import math
import warnings
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ahf_ros.base.extras import need
from ahf_ros.base.opening import Most, opened, reader
from ahf_ros.files.headers import read_header
from ahf_ros.files.heic import register_heic

FILM_DIAGONAL = math.hypot(36, 24)
"""Diagonal of a film frame, mm, which equivalent focal lengths refer to (CIPA DCG-001)."""

_MAKE, _MODEL, _MORE = 271, 272, 34665  # tags; the last one has those of the photograph
_FOCAL_LENGTH, _RESOLUTION, _RESOLUTION_UNIT = 37386, 41486, 41488
_WIDTH, _EQUIVALENT, _SERIAL_NUMBER = 40962, 41989, 42033
_UNITS = {2: 25.4, 3: 10.0, 4: 1.0}  # mm, of resolutions
_LEAST, _MOST = 0.2, 50.0  # focal lengths that are believed, in diagonals of the image


@dataclass(frozen=True, slots=True)
class Exif:
    """What a photograph says of its camera: name, serial number and focal length in mm.

    `focal_length` is 0 where it is not known, `pixels` is the same length in px, None if unknown.
    """

    camera: str = ''
    serial_number: str = ''
    focal_length: float = 0.0
    pixels: float | None = None


@reader('a photograph')
def read_exif(path: str | Path) -> tuple[Exif, tuple[int, int]]:
    """Return the Exif data of an image file, empty where there are none, and width and height.

    These are 0 px where the format is not known. A ValueError names a file that cannot be read.
    Raises a `MissingExtra` without Pillow.
    """
    need('orient', 'PIL')
    from PIL import Image, UnidentifiedImageError

    register_heic()
    try:
        with opened(path, Most.IMAGE) as file, warnings.catch_warnings():
            warnings.simplefilter('ignore')  # large images, damaged fields
            with Image.open(file) as image:
                size, exif = image.size, image.getexif()
                fields = {**exif, **exif.get_ifd(_MORE)}
                if image.format == 'TIFF':  # the first image may be a preview
                    file.seek(0)
                    header = read_header(file.read())
                    size = (header.width, header.height) if header.width else size
    except (UnidentifiedImageError, Image.DecompressionBombError):
        return Exif(), (0, 0)
    except OSError as error:
        raise ValueError(f'{path} cannot be read: {error.strerror or error}') from error
    name = f'{_text(fields, _MAKE)} {_text(fields, _MODEL)}'.strip()
    length, serial = _number(fields, _FOCAL_LENGTH), _text(fields, _SERIAL_NUMBER)
    return Exif(name, serial, length, _pixels(fields, *size)), size


def equivalent_in_px(millimetres: float, width: int, height: int) -> float:
    """Return the focal length in px of one that is equivalent on film, by the diagonal."""
    return millimetres * math.hypot(width, height) / FILM_DIAGONAL


def _text(fields: dict[int, Any], tag: int) -> str:
    text = str(fields.get(tag, '')).split('\0')[0]
    return ''.join(it for it in text if it.isprintable()).strip()


def _number(fields: dict[int, Any], tag: int) -> float:
    """Return a number that is finite, 0 where there is none."""
    with suppress(TypeError, ValueError, ZeroDivisionError):
        number = float(fields.get(tag, 0))
        return number if math.isfinite(number) else 0.0
    return 0.0


def _pixels(fields: dict[int, Any], width: int, height: int) -> float | None:
    """Return the focal length in px, from the pitch of the pixels or the equivalent on film."""
    unit = _UNITS.get(fields.get(_RESOLUTION_UNIT, 0), math.inf)
    enlarged = max(width, height) / (_number(fields, _WIDTH) or max(width, height))
    lengths = [
        _number(fields, _FOCAL_LENGTH) * _number(fields, _RESOLUTION) / unit * enlarged,
        equivalent_in_px(_number(fields, _EQUIVALENT), width, height),
    ]
    diagonal = math.hypot(width, height)
    return next((it for it in lengths if _LEAST < it / diagonal < _MOST), None)
