"""Images in files, turned or not; every file that cannot be used is named."""

import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.base.extras import missing
from ahf_ros.cli import main
from ahf_ros.cli.identify import image_paths
from ahf_ros.files.exif import read_exif
from ahf_ros.files.headers import read_header
from ahf_ros.files.image_files import decode_bytes, read_image, read_noted_image, write_image

GRAY = np.arange(20 * 30, dtype=np.uint16).reshape(20, 30)
DARK = (GRAY // 4).astype(np.uint8)
ORIENTATIONS = range(1, 9)


@pytest.mark.parametrize(
    ('suffix', 'image'),
    [
        *((suffix, DARK) for suffix in ('.png', '.tif', '.tiff', '.bmp')),
        *((suffix, GRAY * 100) for suffix in ('.png', '.tif')),
    ],
)
def test_what_is_written_is_read(tmp_path: Path, suffix: Any, image: Any) -> None:
    file = tmp_path / 'deep' / f'Prüfkörper{suffix}'
    write_image(file, image)
    read = read_image(file)
    assert read.dtype == image.dtype
    np.testing.assert_array_equal(read, image)


@pytest.mark.parametrize('suffix', ['.jpg', '.jpeg', '.png'])
@pytest.mark.parametrize('channels', [3, 4])
def test_colour_turns_to_gray(tmp_path: Path, suffix: str, channels: int) -> None:
    colour = np.full((20, 30, channels), (200, 100, 50, 7)[:channels], np.uint8)
    write_image(tmp_path / f'image{suffix}', colour)
    read = read_image(str(tmp_path / f'image{suffix}'))
    assert read.shape == (20, 30)
    luma = 0.114 * 200 + 0.587 * 100 + 0.299 * 50
    np.testing.assert_allclose(read, luma, atol=2)


def test_float_images_keep_their_values(tmp_path: Path) -> None:
    image = GRAY.astype(np.float32) / 7
    cv2.imwrite(str(tmp_path / 'image.tif'), image)
    np.testing.assert_array_equal(read_image(tmp_path / 'image.tif'), image)


def test_files_that_are_no_images_are_named(tmp_path: Path) -> None:
    (tmp_path / 'empty.png').touch()
    (tmp_path / 'text.png').write_text('not an image')
    for name, words in [
        ('missing.png', 'cannot be read: No such file'),
        ('.', 'cannot be read: it is a folder'),
        ('empty.png', 'is empty'),
        ('text.png', 'is not an image'),
    ]:
        with pytest.raises(ValueError, match=words) as caught:
            read_image(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)


def test_images_that_cannot_be_written_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match=r'image.xyz has an unknown format, accepted is one of .bmp'
    ):
        write_image(tmp_path / 'image.xyz', GRAY)
    (tmp_path / 'file').touch()
    with pytest.raises(ValueError, match=r'image.png cannot be written: '):
        write_image(tmp_path / 'file' / 'image.png', GRAY)


def tiff(pixels: np.ndarray, orientation: int, order: str = '<') -> bytes:
    """Return an uncompressed TIFF file of gray or colour pixels."""
    height, width, *rest = pixels.shape
    samples = rest[0] if rest else 1
    bits = 8 * pixels.dtype.itemsize
    data = pixels.astype(pixels.dtype.newbyteorder(order)).tobytes()
    start = 8
    extra = start + len(data)
    depths = struct.pack(f'{order}{samples}H', *[bits] * samples)
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
        layout = 'H2x' if kind == 3 and count == 1 else 'L'
        body += struct.pack(f'{order}HHL{layout}', tag, kind, count, value)
    mark = b'II*\0' if order == '<' else b'MM\0*'
    return mark + struct.pack(f'{order}L', extra + len(depths)) + data + depths + body + bytes(4)


def with_exif(suffix: str, pixels: np.ndarray, orientation: int) -> bytes:
    """Return an encoded image with Exif data."""
    encoded = cv2.imencode(suffix, pixels)[1].tobytes()
    field = struct.pack('>HHLHH', 274, 3, 1, orientation, 0)
    data = b'MM\0*' + struct.pack('>LH', 8, 1) + field + bytes(4)
    if suffix == '.jpg':
        segment = b'Exif\0\0' + data
        added = b'\xff\xe1' + struct.pack('>H', 2 + len(segment)) + segment
        return encoded[:2] + added + encoded[2:]
    chunk = b'eXIf' + data
    added = struct.pack('>L', len(data)) + chunk + struct.pack('>L', zlib.crc32(chunk))
    end = 8 + 25  # behind IHDR
    return encoded[:end] + added + encoded[end:]


def header_of(content: bytes) -> tuple[int, int, int]:
    header = read_header(content)
    return header.width, header.height, header.orientation


@pytest.mark.parametrize('orientation', ORIENTATIONS)
@pytest.mark.parametrize('order', ['<', '>'])
@pytest.mark.parametrize('pixels', [GRAY, DARK, np.dstack([DARK] * 3)], ids=['16', '8', 'colour'])
def test_pixels_of_tiff_are_those_that_are_stored(
    orientation: int, order: str, pixels: Any
) -> None:
    content = tiff(pixels, orientation, order)
    stored = pixels if pixels.ndim == 2 else pixels[:, :, 0]
    np.testing.assert_array_equal(decode_bytes(content, 'image').image, stored)
    assert header_of(content) == (30, 20, orientation)


@pytest.mark.parametrize('orientation', ORIENTATIONS)
@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_pixels_of_other_formats_are_those_that_are_stored(orientation: int, suffix: str) -> None:
    content = with_exif(suffix, DARK, orientation)
    plain = cv2.imdecode(cv2.imencode(suffix, DARK)[1], cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(decode_bytes(content, 'image').image, plain)
    assert header_of(content) == (30, 20, orientation)


def test_the_orientation_is_reported(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'turned.tif'
    path.write_bytes(tiff(GRAY, 6))
    assert read_noted_image(path).note.startswith(f'{path}: orientation 6 is not applied')
    assert main(['identify', str(path), '--detector', 'traditional']) == 0
    assert 'orientation 6 is not applied' in capfd.readouterr().err
    for none in (0, 1, 9):
        path.write_bytes(tiff(GRAY, none))
        assert read_noted_image(path, upright=True).note == ''


@pytest.mark.parametrize('suffix', ['.png', '.jpg', '.bmp', '.tif'])
def test_images_that_are_too_large_are_named_before_they_are_decoded(
    suffix: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wide = np.zeros((16, 40_000), np.uint8)
    (tmp_path / f'wide{suffix}').write_bytes(cv2.imencode(suffix, wide)[1].tobytes())
    monkeypatch.setattr(cv2, 'imdecode', None)
    monkeypatch.setattr('ahf_ros.vision.image._MAXIMUM_SIDE', 30_000)
    with pytest.raises(ValueError, match='is 40000 x 16 px, accepted are sides of at most 30000'):
        read_image(tmp_path / f'wide{suffix}')


def test_a_bomb_is_named(tmp_path: Path) -> None:
    content = bytearray(cv2.imencode('.png', np.zeros((20, 20), np.uint8))[1].tobytes())
    content[16:24] = struct.pack('>LL', 32_000, 32_000)
    with pytest.raises(ValueError, match='is 32000 x 32000 px, accepted are'):
        decode_bytes(content, 'bomb')


def test_damaged_headers_are_no_error() -> None:
    assert read_header(b'II+\0' + struct.pack('<HHQ', 8, 0, 2**64 - 1)) == read_header(b'')
    whole = [tiff(GRAY, 6), with_exif('.jpg', DARK, 3)]
    random = np.random.default_rng(0)
    for content in whole:
        for size in range(0, len(content), 7):
            read_header(content[:size])
        for _ in range(300):
            changed = np.frombuffer(content, np.uint8).copy()
            changed[random.integers(0, len(changed), 5)] = random.integers(0, 256, 5)
            read_header(changed.tobytes())


def paged(*directories: list[tuple[int, int, int]], parts: int = 0, order: str = '<') -> bytes:
    """Return a TIFF whose directories have fields of one integer, and strips of gray values.

    Each field is a tag, a type and a value; each strip has a value of its own. The last `parts`
    directories belong to the first one, the others follow each other.
    """
    content = bytearray(struct.pack(f'{order}2sHL', b'II' if order == '<' else b'MM', 42, 8))
    pages = len(directories) - parts
    size = sum(2 + 12 * (len(it) + 3) + 4 for it in directories) + 12
    strips, places, place = b'', [], 8
    for number, fields in enumerate(directories):
        places.append(place)
        place += 2 + 12 * (len(fields) + 2 + (parts > 0 and number == 0)) + 4
    for number, fields in enumerate(directories):
        value = dict((tag, it) for tag, _, it in fields)
        strip = bytes(range(number, number + 50)) * (value[256] * value[257] // 50)
        own = [*fields, (273, 4, size + len(strips)), (279, 4, len(strip))]
        if parts and number == 0:
            own.append((330, 4, places[pages]))
        strips += strip
        content += struct.pack(f'{order}H', len(own))
        for tag, kind, it in sorted(own):
            word = struct.pack(f'{order}H2x' if kind == 3 else f'{order}L', it)
            content += struct.pack(f'{order}HHL', tag, kind, 1) + word
        content += struct.pack(f'{order}L', places[number + 1] if number + 1 < pages else 0)
    return bytes(content) + bytes(size - len(content)) + strips


def page(width: int, height: int, reduced: int = 0, colours: int = 1, **more: int) -> list:
    fields = [(254, 4, reduced), (256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1)]
    return [*fields, (262, 3, colours), *((274, 3, it) for it in more.values())]


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize('parts', [0, 1])
def test_the_image_of_full_size_is_read_wherever_it_is(order: Any, parts: int) -> None:
    content = paged(page(25, 20, 1), page(50, 40, orientation=6), parts=parts, order=order)
    noted = decode_bytes(content, 'a.tif')
    assert noted.image.shape == (40, 50)
    assert noted.image[0, 0] == 1  # of the second directory
    assert (noted.orientation, noted.note, noted.damage) == (6, '', '')
    header = read_header(content)
    assert (header.width, header.height, header.pages) == (50, 40, 1)


def test_the_size_of_a_photograph_is_that_of_its_full_image(tmp_path: Path) -> None:
    pytest.importorskip('PIL')
    path = tmp_path / 'a.tif'
    path.write_bytes(paged(page(25, 20, 1), page(50, 40)))
    assert read_exif(path)[1] == (50, 40)


def test_pages_and_raw_images_are_named() -> None:
    noted = decode_bytes(paged(page(50, 40), page(50, 40), page(50, 40)), 'a.tif')
    assert noted.note == 'a.tif has 3 pages, the first is read'
    assert noted.image[0, 0] == 0
    for colours in (32803, 34892):
        raw = paged(page(25, 20, 1), page(50, 40, 0, colours), parts=1)
        with pytest.raises(
            ValueError, match=r'a\.dng is a raw image, accepted is .* in full size'
        ):
            decode_bytes(raw, 'a.dng')


@pytest.mark.parametrize(
    ('begin', 'kind'),
    [
        (b'\0\0\0\x18ftypheic\0\0\0\0', 'HEIC'),
        (b'\0\0\0\x0cJXL \r\n', 'JPEG XL'),
        (b'\0\0\0\x0cjP  \r\n', 'JPEG 2000'),
        (b'FUJIFILMCCD-RAW 0201', 'a raw image'),
    ],
)
def test_formats_of_cameras_that_are_not_read_are_named(
    begin: bytes, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pillow_heif', None)
    with pytest.raises(ValueError, match=rf'a is {kind}, accepted is .*convert it in full size'):
        decode_bytes(begin + bytes(100), 'a')


@pytest.mark.parametrize('prefix', [b'', b'Exif\0\0'])
def test_the_orientation_of_webp_is_that_of_its_exif(tmp_path: Path, prefix: bytes) -> None:
    _, encoded = cv2.imencode('.webp', DARK)
    exif = prefix + b'MM\0*\0\0\0\x08\0\1\1\x12\0\3\0\0\0\1\0\6\0\0\0\0\0\0'
    sides = (DARK.shape[1] - 1).to_bytes(3, 'little') + (DARK.shape[0] - 1).to_bytes(3, 'little')
    chunks = b'VP8X' + struct.pack('<L', 10) + b'\x08\0\0\0' + sides + encoded.tobytes()[12:]
    chunks += b'EXIF' + struct.pack('<L', len(exif)) + exif
    path = tmp_path / 'a.webp'
    path.write_bytes(b'RIFF' + struct.pack('<L', 4 + len(chunks)) + b'WEBP' + chunks)
    assert read_noted_image(path).orientation == 6
    assert read_image(path).shape == DARK.shape
    assert read_image(path, upright=True).shape == DARK.shape[::-1]


def test_missing_pixels_of_floats_are_0(tmp_path: Path) -> None:
    image = 1 + DARK.astype(np.float32)
    image[3, 4:7] = np.nan, np.inf, -np.inf
    cv2.imwrite(str(tmp_path / 'a.tif'), image)
    found = read_image(tmp_path / 'a.tif')
    assert found[3, 4:7].tolist() == [0, 0, 0]
    assert (found > 0).sum() == image.size - 3
    cv2.imwrite(str(tmp_path / 'a.tif'), np.full_like(image, np.nan))
    assert np.isnan(read_image(tmp_path / 'a.tif')).all()  # for whoever checks images


def test_what_is_left_out_of_a_folder_is_counted_by_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pillow_heif', None)
    for name in ('a.png', 'a.HEIC', 'b.heic', 'c.cr2', 'list'):
        (tmp_path / name).touch()
    (tmp_path / 'folder').mkdir()
    paths, problems, left_out = image_paths([str(tmp_path)])
    assert (paths, problems) == ([str(tmp_path / 'a.png')], [])
    assert [it.partition(';')[0] for it in left_out] == [
        f'{tmp_path}: left out are 2 .heic, 1 .cr2, 1 without an ending'
    ]
    assert left_out[0].endswith(missing('heic'))
