from typing import Any

import numpy as np
import pytest

from ahf_ros.vision.image import IMAGE_TYPES, MINIMUM_SIDE, check_image

RAMP = np.arange(20 * 30).reshape(20, 30) % 251


@pytest.mark.parametrize('kind', IMAGE_TYPES)
def test_every_accepted_type_passes_in_any_order_read_only_and_in_the_smallest_size(
    kind: Any,
) -> None:
    image = RAMP.astype(kind)
    image.flags.writeable = False
    check_image(image[::-1])
    check_image(np.asfortranarray(image))
    check_image(image[:MINIMUM_SIDE, :MINIMUM_SIDE])


@pytest.mark.parametrize(
    ('image', 'words'),
    [
        (None, 'NoneType'),
        ('photo.jpg', 'str'),
        ([[1, 2], [3, 4]], 'list'),
        (np.zeros((0, 0), np.uint8), '0 x 0 px'),
        (np.zeros((0, 100), np.uint8), '100 x 0 px'),
        (np.zeros((1, 1), np.uint8), '1 x 1 px'),
        (RAMP[:1].astype(np.uint8), '30 x 1 px'),
        (RAMP[:15].astype(np.uint8), '30 x 15 px'),
        (np.zeros((20, 30, 3), np.uint8), r'shape \(20, 30, 3\)'),
        (np.zeros(100, np.uint8), r'shape \(100,\)'),
        (RAMP.astype(np.int32), 'int32'),
        (RAMP.astype(np.int8), 'int8'),
        (RAMP.astype(np.float16), 'float16'),
        (RAMP.astype(np.complex64), 'complex64'),
        (RAMP > 3, 'bool'),
        (RAMP.astype('>u2'), '>u2'),
        (np.full((20, 30), 7, np.uint8), 'constant, 7'),
        (np.zeros((20, 30), np.float32), 'constant, 0'),
        (np.where(RAMP == 5, np.nan, RAMP), 'NaN'),
        (np.where(RAMP == 5, np.inf, RAMP), 'infinite'),
        (np.where(RAMP == 5, -np.inf, RAMP), 'infinite'),
        ((RAMP - 2.5).astype(np.float32), 'down to -2.5'),
    ],
)
def test_everything_else_is_refused_by_name(image: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=f'^frame .*{words}.*accepted'):
        check_image(image, 'frame')
