"""Orientation and size of image files, whatever wrote them."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.cli import main
from ahf_ros.interchange.image_files import (
    decode_bytes,
    read_header,
    read_image,
    read_noted_image,
)

IMAGE = np.arange(24 * 36, dtype=np.uint16).reshape(24, 36)
ORIENTATIONS = range(1, 9)


def tiff(pixels: np.ndarray, orientation: int, order: str = '<') -> bytes:
    """Return an uncompressed TIFF file of gray or colour pixels."""
    height, width, *rest = pixels.shape
    samples = rest[0] if rest else 1
    bits = 8 * pixels.dtype.itemsize
    data = pixels.astype(pixels.dtype.newbyteorder(order)).tobytes()
    start = 8
    extra = start + len(data)
    depths = struct.pack(f'{order}{samples}H', *[bits] * samples)
    directory = extra + len(depths)
    fields = [
        (256, 4, 1, width),
        (257, 4, 1, height),
        (258, 3, samples, extra if samples > 2 else bits),
        (259, 3, 1, 1),
        (262, 3, 1, 2 if samples == 3 else 1),
        (273, 4, 1, start),
        (274, 3, 1, orientation),
        (277, 3, 1, samples),
        (278, 4, 1, height),
        (279, 4, 1, len(data)),
    ]
    body = struct.pack(f'{order}H', len(fields))
    for tag, kind, count, value in fields:
        short = kind == 3 and count == 1
        body += struct.pack(f'{order}HHL', tag, kind, count)
        body += struct.pack(
            f'{order}HH' if short else f'{order}L', *([value, 0] if short else [value])
        )
    mark = b'II*\0' if order == '<' else b'MM\0*'
    return mark + struct.pack(f'{order}L', directory) + data + depths + body + bytes(4)


def exif(orientation: int) -> bytes:
    field = struct.pack('>HHLHH', 274, 3, 1, orientation, 0)
    return b'MM\0*' + struct.pack('>LH', 8, 1) + field + bytes(4)


def with_exif(suffix: str, pixels: np.ndarray, orientation: int) -> bytes:
    """Return an encoded image with Exif data."""
    encoded = cv2.imencode(suffix, pixels)[1].tobytes()
    data = exif(orientation)
    if suffix == '.jpg':
        segment = b'Exif\0\0' + data
        return (
            encoded[:2] + b'\xff\xe1' + struct.pack('>H', 2 + len(segment)) + segment + encoded[2:]
        )
    import zlib

    chunk = b'eXIf' + data
    end = 8 + 25  # behind IHDR
    inserted = struct.pack('>L', len(data)) + chunk + struct.pack('>L', zlib.crc32(chunk))
    return encoded[:end] + inserted + encoded[end:]


@pytest.mark.parametrize('orientation', ORIENTATIONS)
@pytest.mark.parametrize('order', ['<', '>'])
@pytest.mark.parametrize('kind', [np.uint8, np.uint16])
def test_pixels_of_tiff_are_those_that_are_stored(orientation, order, kind):
    pixels = IMAGE.astype(kind)
    content = tiff(pixels, orientation, order)
    np.testing.assert_array_equal(decode_bytes(content, 'image'), pixels)
    header = read_header(content)
    assert (header.width, header.height, header.orientation) == (36, 24, orientation)


@pytest.mark.parametrize('orientation', ORIENTATIONS)
def test_pixels_of_colour_tiff_are_those_that_are_stored(orientation):
    pixels = np.repeat(IMAGE.astype(np.uint8)[:, :, None], 3, axis=2)
    np.testing.assert_array_equal(
        decode_bytes(tiff(pixels, orientation), 'image'), pixels[:, :, 0]
    )


@pytest.mark.parametrize('orientation', ORIENTATIONS)
@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_pixels_of_other_formats_are_those_that_are_stored(orientation, suffix):
    pixels = (IMAGE // 4).astype(np.uint8)
    content = with_exif(suffix, pixels, orientation)
    plain = cv2.imdecode(cv2.imencode(suffix, pixels)[1], cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(decode_bytes(content, 'image'), plain)
    header = read_header(content)
    assert (header.width, header.height, header.orientation) == (36, 24, orientation)


def test_the_orientation_is_reported(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    path = tmp_path / 'turned.tif'
    path.write_bytes(tiff(IMAGE, 6))
    assert read_noted_image(path)[1].startswith(f'{path}: orientation 6 is not applied')
    assert main(['identify', str(path), '--detector', 'traditional']) == 0
    assert 'orientation 6 is not applied' in capfd.readouterr().err
    path.write_bytes(tiff(IMAGE, 1))
    assert read_noted_image(path)[1] == ''


@pytest.mark.parametrize('suffix', ['.png', '.jpg', '.bmp', '.tif'])
def test_images_that_are_too_large_are_named_before_they_are_decoded(
    suffix, monkeypatch, tmp_path
):
    wide = np.zeros((16, 40_000), np.uint8)
    (tmp_path / f'wide{suffix}').write_bytes(cv2.imencode(suffix, wide)[1].tobytes())
    monkeypatch.setattr(cv2, 'imdecode', None)
    with pytest.raises(ValueError, match='is 40000 x 16 px, accepted are sides of at most 32767'):
        read_image(tmp_path / f'wide{suffix}')


def test_a_bomb_is_named(tmp_path):
    content = bytearray(cv2.imencode('.png', np.zeros((20, 20), np.uint8))[1].tobytes())
    content[16:24] = struct.pack('>LL', 32_000, 32_000)
    with pytest.raises(ValueError, match='is 32000 x 32000 px, accepted are'):
        decode_bytes(content, 'bomb')


def test_damaged_headers_are_no_error():
    whole = [tiff(IMAGE, 6), with_exif('.jpg', IMAGE.astype(np.uint8), 3)]
    random = np.random.default_rng(0)
    for content in whole:
        for size in range(0, len(content), 7):
            read_header(content[:size])
        for _ in range(300):
            changed = np.frombuffer(content, np.uint8).copy()
            changed[random.integers(0, len(changed), 5)] = random.integers(0, 256, 5)
            read_header(changed.tobytes())
