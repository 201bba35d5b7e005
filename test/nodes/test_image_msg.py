from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.interchange.image_messages import decode_image
from ahf_ros.nodes.messages import image_message

GRAY = np.arange(12, dtype=np.uint8).reshape(3, 4)


def message(encoding: str = 'mono8', step: int = 4, data: bytes | None = None, **fields) -> Image:
    values = {'height': 3, 'width': 4, 'encoding': encoding, 'step': step} | fields
    return Image(data=GRAY.tobytes() if data is None else data, **values)


@pytest.mark.parametrize(
    ('fields', 'error'),
    [
        ({'encoding': '8SC1'}, "encoding is '8SC1', accepted is one of mono8, mono16, rgb8"),
        ({'encoding': ''}, "encoding is '', accepted is one of"),
        ({'width': 0}, 'width is 0, accepted is an integer of at least 1'),
        ({'height': 0}, 'height is 0, accepted is an integer of at least 1'),
        ({'step': 3}, 'step is 3, accepted is an integer of at least 4'),
        ({'step': 0}, 'step is 0, accepted is an integer of at least 4'),
        ({'encoding': 'bgr8'}, 'step is 4, accepted is an integer of at least 12'),
        ({'data': GRAY.tobytes()[:-1]}, 'data has 11 bytes, accepted are at least 12'),
        ({'data': b''}, 'data has 0 bytes, accepted are at least 12'),
        (
            {'height': 2**32 - 1, 'width': 2**32 - 1, 'step': 2**32 - 1},
            'data has 12 bytes, accepted are at least 18446744065119617025',
        ),
    ],
)
def test_what_does_not_fit_is_named(fields: dict, error: str) -> None:
    with pytest.raises(ValueError, match=error):
        decode_image(message(**fields))


@pytest.mark.parametrize('image', [GRAY, GRAY.T, np.stack((GRAY, GRAY + 100, GRAY), axis=2)])
def test_a_message_holds_the_image_row_by_row(image: np.ndarray) -> None:
    header = Header(frame_id='camera')
    sent = image_message(image, header)
    assert sent.header == header
    assert (sent.height, sent.width) == image.shape[:2]
    assert sent.encoding == ('mono8' if image.ndim == 2 else 'bgr8')
    assert sent.step == sent.width * (1 if image.ndim == 2 else 3)
    assert bytes(sent.data) == image.tobytes()
