"""Packets of video as gray images, by PyAV, which the extra `video` brings.

ffmpeg_image_transport sends each image as a packet of H.264, HEVC or another codec of FFmpeg.
Nearly every packet needs those before it, from the last key frame on.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ahf_ros.base.extras import need
from ahf_ros.vision.image import check_size

_KEY_FRAME = 1  # in the flags of a packet, AV_PKT_FLAG_KEY of FFmpeg
_MOST_LATE = 16  # images that a codec may hold back to put them in order
_CODECS = {'264': 'h264', 'h265': 'hevc', 'x265': 'hevc', 'hevc': 'hevc', 'av1': 'av1'}
_OTHERS = 'mjpeg', 'ffv1', 'vp8', 'vp9', 'mpeg4'


def codec_of(encoding: str) -> str:
    """Return the codec of a packet whose encoding names it, or the encoder, before a semicolon.

    Raise a ValueError if it is none that is decoded.

    Examples
    --------
    >>> codec_of('libx264'), codec_of('hevc_nvenc'), codec_of('h264;yuv420p;bgr8;bgr8')
    ('h264', 'hevc', 'h264')
    """
    name = encoding.partition(';')[0]
    for part, codec in (*_CODECS.items(), *((it, it) for it in _OTHERS)):
        if part in name.lower():
            return codec
    accepted = ', '.join(dict.fromkeys((*_CODECS.values(), *_OTHERS)))
    raise ValueError(f'encoding is {encoding!r}, accepted is video of one of {accepted}')


class VideoDecoder:
    """Decodes the packets of one camera in their order; what it needs to know, it remembers.

    Raises
    ------
    ahf_ros.base.extras.MissingExtra
        If PyAV is not installed.
    """

    def __init__(self) -> None:
        need('video')
        self._context: Any = None
        self._codec = ''
        self._waiting: dict[int, Any] = {}  # headers of packets by their number
        self._number = 0

    def decode(self, message: Any) -> Iterator[tuple[Any, np.ndarray | None]]:
        """Yield header and image, uint8 or uint16, of each image that a packet completes.

        The image is None of a packet that gave none, as it may be where it is damaged.

        `message` is an ffmpeg_image_transport_msgs/FFMPEGPacket. Most often it completes its own
        image, but a codec may need later packets as well. A ValueError says why a packet is not
        decoded; what follows is refused until the next key frame.
        """
        import av

        codec = codec_of(message.encoding)
        check_size(message.width, message.height, 'video')
        if codec != self._codec or self._context is None:
            if not message.flags & _KEY_FRAME:
                raise ValueError('no key frame has come, without which video is not decoded')
            self._begin(codec)
        self._number += 1
        self._waiting[self._number] = message.header
        packet = av.Packet(bytes(message.data))
        packet.pts = packet.dts = self._number
        try:
            frames = self._context.decode(packet)
        except av.error.FFmpegError as error:
            self._context = None
            raise ValueError(f'a packet of {codec} is not decoded: {error.strerror}') from error
        for frame in frames:
            header = self._waiting.pop(frame.pts, message.header)
            deep = any(it.bits > 8 for it in frame.format.components)
            yield header, frame.to_ndarray(format='gray16le' if deep else 'gray')
        late = _MOST_LATE if self._context.has_b_frames else 0
        while len(self._waiting) > late:
            yield self._waiting.pop(min(self._waiting)), None

    def _begin(self, codec: str) -> None:
        import av

        self._codec = codec
        self._waiting.clear()
        self._context = av.CodecContext.create(codec, 'r')
        # Threads that decode several images at a time would hold each of them back.
        self._context.thread_type = 'SLICE'
