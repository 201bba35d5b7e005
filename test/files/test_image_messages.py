"""Image messages of every encoding, as ROS and rosbags have them."""

import struct
import sys
import zlib
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahf_ros.families import create_detector
from ahf_ros.files.image_messages import ENCODINGS, WITH_PLANES, decode_compressed, decode_image
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.image import as_gray, check_image
from support.hostile import IMAGES, SIDES, Fields, generators, mutated

GRAY = np.arange(40, 100, dtype=np.uint8).reshape(6, 10)
COLOURS = np.dstack([GRAY, GRAY[::-1], 255 - GRAY])  # blue, green, red
NATIVE = sys.byteorder == 'big'


def message(
    encoding: str, pixels: np.ndarray, big: bool = NATIVE, padding: int = 0, **changes: Any
) -> SimpleNamespace:
    """Return a message as it is duck-typed: pixels of shape (height, width, ...)."""
    height, width = pixels.shape[:2]
    sent = pixels.astype(pixels.dtype.newbyteorder('>' if big else '<'))
    rows = np.frombuffer(sent.tobytes(), np.uint8).reshape(height, -1)
    data = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    fields = {
        'height': height,
        'width': width,
        'encoding': encoding,
        'is_bigendian': int(big),
        'step': data.shape[1],
        'data': data.ravel(),
    }
    return SimpleNamespace(**fields | changes)


@pytest.mark.parametrize('big', [False, True])
@pytest.mark.parametrize('padding', [0, 1, 3, 8])
@pytest.mark.parametrize(
    ('encoding', 'kind'),
    [
        ('mono8', np.uint8),
        ('8UC1', np.uint8),
        ('mono16', np.uint16),
        ('16UC1', np.uint16),
        ('32FC1', np.float32),
        ('64FC1', np.float64),
    ],
)
def test_gray_keeps_its_values_and_its_type_without_a_copy(
    encoding: str, kind: Any, padding: int, big: bool
) -> None:
    pixels = GRAY.astype(kind) * (37 if kind != np.uint8 else 1)
    sent = message(encoding, pixels, big, padding)
    image = decode_image(sent)
    assert image.dtype == kind and image.dtype.isnative and image.flags.aligned
    assert np.array_equal(image, pixels)
    if big == NATIVE and not padding:
        assert np.shares_memory(image, sent.data)


@pytest.mark.parametrize('big', [False, True])
@pytest.mark.parametrize('bits', [8, 16])
@pytest.mark.parametrize('order', ['rgb', 'bgr', 'rgba', 'bgra'])
def test_colours_are_weighted(order: str, bits: int, big: bool) -> None:
    scale, kind = {8: (1, np.uint8), 16: (257, np.uint16)}[bits]
    channels = {'b': 0, 'g': 1, 'r': 2}
    planes = [COLOURS[..., channels[name]] if name != 'a' else 0 * GRAY for name in order]
    image = decode_image(message(f'{order}{bits}', np.dstack(planes).astype(kind) * scale, big, 5))
    assert image.dtype == kind
    expected = scale * (COLOURS @ [0.114, 0.587, 0.299])
    assert np.abs(image - expected).max() <= scale


@pytest.mark.parametrize('kind', ['8U', '16U', '32F', '64F'])
def test_channels_without_a_name(kind: str) -> None:
    dtype = {'8U': 'u1', '16U': 'u2', '32F': 'f4', '64F': 'f8'}[kind]
    expected = COLOURS @ [0.114, 0.587, 0.299]
    for samples in (3, 4):
        pixels = np.dstack([COLOURS, GRAY])[..., :samples].astype(dtype)
        image = decode_image(message(f'{kind}C{samples}', pixels))
        assert image.dtype == dtype
        assert np.abs(image - expected).max() <= 1
    pair = np.dstack([GRAY, 0 * GRAY]).astype(dtype)
    assert np.array_equal(decode_image(message(f'{kind}C2', pair)), GRAY)


@pytest.mark.parametrize('bits', [8, 16])
@pytest.mark.parametrize('pattern', ['rggb', 'bggr', 'gbrg', 'grbg'])
def test_bayer_patterns_show_the_colour_that_they_are_of(pattern: str, bits: int) -> None:
    """Only the red cells of an even red light are bright: 0.299 of white in every pixel."""
    kind, white = {8: (np.uint8, 200), 16: (np.uint16, 50000)}[bits]
    cell = np.array([of == 'r' for of in pattern]).reshape(2, 2) * white
    image = decode_image(message(f'bayer_{pattern}{bits}', np.tile(cell, (8, 8)).astype(kind)))
    assert image.dtype == kind
    assert image[2:-2, 2:-2] == pytest.approx(0.299 * white, rel=0.02)


NEUTRAL = np.full((12, 10), 128, np.uint8)


@pytest.mark.parametrize(
    ('encoding', 'pixels'),
    [
        ('yuv422', np.dstack([NEUTRAL[:6], GRAY])),
        ('uyvy', np.dstack([NEUTRAL[:6], GRAY])),
        ('yuv422_yuy2', np.dstack([GRAY, NEUTRAL[:6]])),
        ('yuyv', np.dstack([GRAY, NEUTRAL[:6]])),
        *((it, np.concatenate([GRAY, NEUTRAL[:3]])) for it in ('nv21', 'nv12', 'i420')),
        ('nv24', np.concatenate([GRAY, NEUTRAL])),
    ],
)
def test_brightness_of_yuv_beside_and_before_the_colours(encoding: Any, pixels: Any) -> None:
    sent = message(encoding, pixels, padding=3, height=len(GRAY))
    assert np.array_equal(decode_image(sent), GRAY)


def test_pixels_without_a_value_are_black() -> None:
    pixels = GRAY.astype(np.float32)
    pixels[2, 3], pixels[0, 0] = np.nan, np.inf
    image = decode_image(message('32FC1', pixels))
    assert image[2, 3] == image[0, 0] == 0
    assert image[5, 5] == GRAY[5, 5]
    nothing = decode_image(message('32FC1', np.full((4, 4), np.nan, np.float32)))
    assert np.isnan(nothing).all()  # which is refused where an image is meant


@pytest.mark.parametrize('encoding', ['8SC1', '16SC1', '32SC1', 'compressedDepth', '', 'MONO8'])
def test_encodings_that_hold_no_image_are_named(encoding: str) -> None:
    with pytest.raises(ValueError, match=f"encoding is '{encoding}', accepted is one of mono8"):
        decode_image(message(encoding, GRAY))


@pytest.mark.parametrize(
    ('fields', 'error'),
    [
        ({'width': 0}, 'width is 0, accepted is an integer of at least 1'),
        ({'height': 0}, 'height is 0, accepted is an integer of at least 1'),
        ({'step': 9}, 'step is 9, accepted is an integer of at least 10'),
        ({'step': 0}, 'step is 0, accepted is an integer of at least 10'),
        ({'encoding': 'bgr8'}, 'step is 10, accepted is an integer of at least 30'),
        ({'data': GRAY.ravel()[:-1].copy()}, 'data has 59 bytes, accepted are at least 60'),
        ({'data': b''}, 'data has 0 bytes, accepted are at least 60'),
        (
            {'height': 2**32 - 1, 'width': 2**32 - 1, 'step': 2**32 - 1},
            'data has 60 bytes, accepted are at least 18446744065119617025',
        ),
    ],
)
def test_a_header_that_does_not_fit_the_data_is_named(fields: Any, error: str) -> None:
    fitting = message('mono8', GRAY)
    with pytest.raises(ValueError, match=error):
        decode_image(SimpleNamespace(**vars(fitting) | fields))


def test_data_that_is_longer_than_its_rows_is_named_but_for_planes_of_colour() -> None:
    long = message('mono8', GRAY)
    rows, step = long.height, long.step
    long.data = np.concatenate([np.asarray(long.data), np.zeros(4, np.uint8)])
    words = f'data has {len(long.data)} bytes, accepted are {rows * step}: {rows} rows of {step} b'
    with pytest.raises(ValueError, match=words):
        decode_image(long)
    long.encoding = 'nv24'
    assert (decode_image(long) == GRAY).all()


SCENE = render(SceneSettings(width=800, height=600, targets=6, seed=5))
IDS = [target.id for target in SCENE.targets]


def with_hot_pixel(image: np.ndarray, value: float) -> np.ndarray:
    changed = image.copy()
    changed[7, 9] = value
    return changed


def with_holes(image: np.ndarray) -> np.ndarray:
    changed = with_hot_pixel(image, 1e6)
    changed[:50, :60] = np.nan
    return changed


@pytest.mark.parametrize(
    ('encoding', 'pixels'),
    [
        # phoxi_camera publishes textures as mono16 or 32FC1, 12 bit of a 16-bit range.
        ('mono16', with_hot_pixel(SCENE.image.astype(np.uint16) * 16, 65535)),
        ('mono16', with_hot_pixel(SCENE.image.astype(np.uint16) * 16, 4095)),
        ('32FC1', with_holes(SCENE.image.astype(np.float32) * 3.7)),
        # zivid_camera publishes color/image_color as rgba8.
        ('rgba8', np.dstack([SCENE.image] * 3 + [np.full_like(SCENE.image, 255)])),
        # ensenso_camera publishes mono8, mono16 or rgb8, by camera and parameter set.
        ('mono8', SCENE.image),
        ('mono16', SCENE.image.astype(np.uint16) * 256),
        ('rgb8', np.dstack([SCENE.image] * 3)),
    ],
)
def test_targets_are_identified_in_what_scanners_publish(encoding: str, pixels: Any) -> None:
    sent = message(encoding, pixels, padding=16)
    assert [
        target.id for target in create_detector('ring', family='metashape12')(decode_image(sent))
    ] == IDS


@pytest.mark.parametrize('depth', [9, 10, 12, 16])
def test_few_used_bits_make_the_same_gray_values(depth: int) -> None:
    """An image needs 100000 pixels before one of them may be hot."""
    image = (SCENE.image.astype(np.uint16) + 1) << (depth - 8)
    gray = as_gray(with_hot_pixel(image, 2**depth - 1))
    assert gray.max() == 255
    expected = np.minimum(SCENE.image + 1.0, SCENE.image.max() + 1.0) / (SCENE.image.max() + 1.0)
    error = np.abs(gray / 255 - expected)
    error[7, 9] = 0
    assert error.max() < 0.02


def test_compressed_images_keep_their_depth() -> None:
    for image in (GRAY, GRAY.astype(np.uint16) * 200):
        _, data = cv2.imencode('.png', image)
        told = SimpleNamespace(format='mono16; png compressed', data=data.ravel())
        decoded = decode_compressed(told).image
        assert decoded.dtype == image.dtype
        assert np.array_equal(decoded, image)
    _, data = cv2.imencode('.jpg', COLOURS)
    told = SimpleNamespace(format='bgr8; jpeg compressed', data=data.ravel())
    decoded = decode_compressed(told).image
    assert np.abs(decoded - COLOURS @ [0.114, 0.587, 0.299]).mean() < 4
    with pytest.raises(ValueError, match=r"data of format 'jpeg' is not an image"):
        decode_compressed(SimpleNamespace(format='jpeg', data=np.zeros(3, np.uint8)))


NAMES = ('encoding', 'width', 'height', 'step', 'data', 'image')
"""What a reason for a refusal begins with."""


def attempt(decode: Callable[[Any], np.ndarray], fields: Fields) -> np.ndarray | None:
    """Return the image that a message is taken for; None where it is refused with a reason."""
    try:
        image = decode(SimpleNamespace(**fields))
        check_image(image)
    except ValueError as error:
        assert str(error).split()[0] in NAMES, error
        return None
    gray = as_gray(image)
    assert gray.shape == image.shape
    assert np.isfinite(gray).all()
    return image


@given(IMAGES)
def test_any_message_is_an_image_or_refused(fields: Any) -> None:
    image = attempt(decode_image, fields)
    if image is None:
        return
    assert image.shape == (fields['height'], fields['width'])
    # Neither what lies behind the rows nor what planes lie behind the image is looked at.
    row = fields['width'] * ENCODINGS[fields['encoding']].size
    size = fields['step'] * fields['height']
    rows = np.frombuffer(fields['data'][:size], np.uint8).reshape(-1, fields['step']).copy()
    rows[:, row:] ^= 255
    planes = [b'\xff' * 99] if fields['encoding'] in WITH_PLANES else []
    for more in (b'', *planes):
        other = attempt(decode_image, {**fields, 'data': rows.tobytes() + more})
        assert other is not None
        assert np.array_equal(image, other)


@st.composite
def compressed_images(draw: st.DrawFn) -> Fields:
    """Draw a CompressedImage: a file that is whole or damaged, or anything."""
    suffix = draw(st.sampled_from(['.png', '.jpg', '.tiff', '.bmp']))
    channels = draw(st.sampled_from([1, 3]))
    pixels = np.random.default_rng(0).integers(0, 255, (draw(SIDES), 40, channels), np.uint8)
    whole = cv2.imencode(suffix, pixels)[1].tobytes()
    damaged = generators().map(lambda random: mutated(whole, random))
    return {
        'format': draw(st.one_of(st.just(suffix[1:]), st.text(max_size=9))),
        'data': draw(st.one_of(st.just(whole), damaged, damaged, st.binary(max_size=200))),
    }


@given(compressed_images())
def test_any_compressed_message_is_an_image_or_refused(fields: Any) -> None:
    attempt(lambda message: decode_compressed(message).image, fields)


def zstd(image: np.ndarray, encoding: str = 'mono16', cut: int = 0) -> SimpleNamespace:
    """Return a message as zstd_image_transport sends it."""
    height, width = image.shape
    head = struct.pack('<2IB2I', height, width, 0, width * image.itemsize, len(encoding))
    packer = zlib.compressobj(wbits=16 + zlib.MAX_WBITS)
    packed = packer.compress(image.tobytes()) + packer.flush()
    data = head + encoding.encode() + packed[: len(packed) - cut]
    return SimpleNamespace(format='zstd', data=np.frombuffer(data, np.uint8))


def test_images_of_zstd_image_transport_are_read() -> None:
    image = np.arange(600, dtype='<u2').reshape(20, 30)
    assert (decode_compressed(zstd(image)).image == image).all()
    for message, error in (
        (zstd(image, 'mono9'), "encoding is 'mono9', accepted is one of mono8"),
        (zstd(image, cut=100), 'data has [0-9]+ bytes, accepted are at least 1200'),
        (SimpleNamespace(format='zstd', data=b'0123'), 'data has 4 bytes, accepted are at least'),
        (
            SimpleNamespace(format='zstd', data=struct.pack('<2IB2I', 9, 9, 0, 9, 0) + b'none'),
            'data of format zstd cannot be decoded',
        ),
        (
            SimpleNamespace(format='zstd', data=struct.pack('<2IB2I', 2**31, 9, 0, 9, 0)),
            'accepted are sides of at most',
        ),
        (
            SimpleNamespace(format='zstd', data=struct.pack('<2IB2I', 9, 9, 0, 2**31, 0)),
            'step is 2147483648, accepted are at most',
        ),
    ):
        with pytest.raises(ValueError, match=error):
            decode_compressed(message)
