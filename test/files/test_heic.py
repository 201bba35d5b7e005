"""Images of HEIC, as far as the extra for them is installed."""

import io
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.files.exif import read_exif
from ahf_ros.files.image_files import decode_bytes, read_image, read_noted_image
from ahf_ros.vision.image import check_size
from support.command_line import status
from support.scenes import rendering

heif = pytest.importorskip('pillow_heif', reason='pillow-heif is not installed')

RAMP = np.add.outer(np.arange(40), 2 * np.arange(60)).astype(np.uint8)
DEEP = RAMP.astype(np.uint16) << 8


def encoded(image: np.ndarray, mode: str, **options: Any) -> bytes:
    """Return an image of gray values or colours in a file of HEIC, without loss."""
    sides = image.shape[1::-1]
    content = io.BytesIO()
    file = heif.from_bytes(mode=mode, size=sides, data=image.tobytes())
    file.save(content, quality=-1, chroma=444, **options)
    return content.getvalue()


@pytest.mark.parametrize(
    ('mode', 'image'),
    [('L', RAMP), ('RGB', RAMP), ('RGBA', RAMP), ('L;16', DEEP), ('RGB;16', DEEP)],
)
def test_gray_values_are_those_of_the_file(mode: str, image: np.ndarray) -> None:
    channels = len(mode.partition(';')[0])
    colours = np.repeat(image[..., None], channels, axis=2) if channels > 1 else image
    noted = decode_bytes(encoded(colours, mode), 'a.heic')
    assert noted.image.dtype == image.dtype
    scale = 1 if image.dtype == np.uint8 else 256
    np.testing.assert_allclose(noted.image / scale, image / scale, atol=1)
    assert (noted.orientation, noted.note, noted.damage) == (1, '', '')


def test_it_is_turned_once(tmp_path: Path) -> None:
    pillow = pytest.importorskip('PIL.Image')
    heif.register_heif_opener()
    image = pillow.fromarray(RAMP)
    exif = image.getexif()
    exif[0x112], exif[0x10F] = 6, 'Phone'
    image.save(tmp_path / 'a.heic', exif=exif.tobytes(), quality=-1, chroma=444)
    upright = np.rot90(RAMP, -1)
    for asked in (False, True):
        found = read_image(tmp_path / 'a.heic', upright=asked)
        np.testing.assert_allclose(found.astype(float), upright, atol=1)
    noted, size = read_exif(tmp_path / 'a.heic')
    assert (noted.camera, size) == ('Phone', upright.shape[::-1])


def test_the_main_one_of_several_images_is_read() -> None:
    content = io.BytesIO()
    file = heif.from_bytes(mode='L', size=(60, 40), data=RAMP.tobytes())
    file.add_frombytes(mode='L', size=(30, 20), data=RAMP[:20, :30].tobytes())
    file.save(content, quality=-1, primary_index=1)
    noted = decode_bytes(content.getvalue(), 'a.heic')
    assert noted.image.shape == (20, 30)
    assert noted.note == 'a.heic has 2 images, the main one is read'


def test_sizes_are_looked_at_before_anything_is_decoded() -> None:
    content = bytearray(encoded(np.zeros((64, 64), np.uint8), 'L'))  # whole blocks: nothing is cut
    place = content.index(b'ispe') + 8
    for sides in ((70_000, 40), (60_000, 60_000)):
        content[place : place + 8] = b''.join(it.to_bytes(4, 'big') for it in sides)
        with pytest.raises(ValueError) as ours:
            check_size(*sides, 'a.heic')
        with pytest.raises(ValueError, match=r'^a\.heic') as refused:
            decode_bytes(bytes(content), 'a.heic')
        assert str(refused.value) == str(ours.value)


def test_damaged_files_are_named(tmp_path: Path) -> None:
    whole = encoded(RAMP, 'L')
    path = tmp_path / 'a.heic'
    for length in (16, 40, len(whole) // 2, len(whole) - 5):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=rf'^{path}[: ]'):
            read_noted_image(path)


def test_a_folder_of_them_is_identified(tmp_path: Path) -> None:
    shown = rendering(width=640, height=480, targets=3)
    colours = cv2.cvtColor(shown.image, cv2.COLOR_GRAY2RGB)
    (tmp_path / 'IMG_1.HEIC').write_bytes(encoded(colours, 'RGB'))
    (tmp_path / 'IMG_2.txt').touch()
    assert status('identify', tmp_path, '--output', tmp_path / 'out') == 0
    (line,) = (tmp_path / 'out' / 'results.jsonl').read_text().splitlines()
    assert len(json.loads(line)['targets']) == 3
