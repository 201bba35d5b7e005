"""Images of HEIC, as phones take them, decoded by libheif: OpenCV does not know the format."""

from io import BytesIO

import cv2
import numpy as np

from ahf_ros.base.extras import missing, need
from ahf_ros.base.opening import parsing
from ahf_ros.vision.image import check_size

ENDINGS = '.heic', '.heif'
"""Endings of files of HEIC."""


def register_heic() -> None:
    """Let Pillow open HEIC, where the extra for it is installed."""
    if not missing('heic'):
        from pillow_heif import register_heif_opener

        register_heif_opener()


def decoded_heic(content: bytes, name: str) -> tuple[np.ndarray, str]:
    """Return the main image of a HEIC file, and what there is to say of others in it.

    It is of uint8, and of uint16 where samples have more than 8 bit: 10 or 12 are scaled to 16.
    The format demands that readers turn it upright (ISO/IEC 23008-12, 6.5.10), whatever Exif data
    say. Raises a ValueError with the name for one that is damaged or, before it is decoded, too
    large, and a `MissingExtra` without the extra.
    """
    need('heic')
    from pillow_heif import open_heif

    with parsing(name, 'an image of HEIC'):
        file = open_heif(BytesIO(content), convert_hdr_to_8bit=False)
        width, height = file.size
        check_size(width, height, name)
        pixels = np.asarray(file)
    note = f'{name} has {len(file)} images, the main one is read' if len(file) > 1 else ''
    if pixels.ndim == 3 and pixels.shape[2] > 2:
        colours = np.ascontiguousarray(pixels[..., :3])
        return cv2.cvtColor(colours, cv2.COLOR_RGB2GRAY), note
    return pixels if pixels.ndim == 2 else pixels[..., 0].copy(), note
