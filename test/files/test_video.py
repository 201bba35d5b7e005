"""Packets as ffmpeg_image_transport sends them, encoded here, and the images in them."""

from collections.abc import Sequence
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('av', reason='PyAV is not installed')

import av

from ahf_ros.files.video import VideoDecoder, codec_of
from ahf_ros.identification.session import identify
from ahf_ros.scenes.scene import SceneSettings, render

SCENE = SceneSettings(width=320, height=240, targets=3, dot_radius=9.0)


def packets(images: Sequence[np.ndarray], **options: str) -> list[Any]:
    """Return messages of H.264, the header of each with the number of its image."""
    height, width = images[0].shape
    context = av.CodecContext.create('libx264', 'w')
    context.width, context.height, context.pix_fmt = width, height, 'yuv420p'
    context.time_base, context.options = Fraction(1, 30), {'crf': '12', **options}
    encoded = []
    for number, image in enumerate(images):
        frame = av.VideoFrame.from_ndarray(image, 'gray').reformat(format='yuv420p')
        frame.pts = number
        encoded += context.encode(frame)
    encoded += context.encode(None)
    return [
        SimpleNamespace(
            header=it.pts,
            width=width,
            height=height,
            encoding='h264;yuv420p;mono8;mono8',
            flags=int(it.is_keyframe),
            data=bytes(it),
        )
        for it in encoded
    ]


@pytest.fixture(scope='module')
def images() -> list[np.ndarray]:
    first = render(SCENE).image
    return [np.roll(first, 3 * number, axis=1) for number in range(4)]


@pytest.mark.parametrize(('options', 'late'), [({'tune': 'zerolatency'}, 0), ({'bf': '2'}, 2)])
def test_every_image_comes_with_its_header(
    images: list[np.ndarray], options: dict[str, str], late: int
) -> None:
    decoder = VideoDecoder()
    found = [it for sent in packets(images, **options) for it in decoder.decode(sent)]
    assert [header for header, _ in found] == list(range(len(images) - late))
    for number, image in found:
        assert image.dtype == np.uint8
        assert np.abs(image.astype(int) - images[number]).mean() < 2
    first, seen = (
        identify(images[0], family='metashape12'),
        identify(found[0][1], family='metashape12'),
    )
    assert seen.ids.tolist() == first.ids.tolist() != []
    assert np.abs(seen.centres - first.centres).max() < 0.1


def test_what_cannot_be_decoded_is_named_until_the_next_key_frame(
    images: list[np.ndarray],
) -> None:
    sent = packets(images, tune='zerolatency', g='2')
    decoder = VideoDecoder()
    assert [it.flags for it in sent] == [1, 0, 1, 0]
    for _ in range(2):
        with pytest.raises(ValueError, match='no key frame has come'):
            list(decoder.decode(sent[1]))
    assert [header for header, _ in decoder.decode(sent[2])] == [2]
    broken = SimpleNamespace(**vars(sent[3]) | {'data': b'\0\0\0\1\x65' + bytes(30)})
    with pytest.raises(ValueError, match='a packet of h264 is not decoded'):
        list(decoder.decode(broken))
    with pytest.raises(ValueError, match='no key frame has come'):
        list(decoder.decode(sent[3]))
    assert [header for header, _ in decoder.decode(sent[0])] == [0]


@pytest.mark.parametrize('encoding', ['', 'theora', 'draco'])
def test_what_is_no_known_video_is_named(encoding: str) -> None:
    with pytest.raises(ValueError, match=f"encoding is '{encoding}', accepted is video of one of"):
        codec_of(encoding)
