"""Images that are too long for OpenCV are interpolated in parts, as others are."""

import numpy as np
import pytest

from ahf_ros.vision import resampling
from ahf_ros.vision.resampling import remapped

KINDS = (np.uint8, np.uint16, np.int16, np.float32)


@pytest.mark.parametrize('kind', KINDS)
def test_parts_give_the_values_of_the_whole(kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(1)
    image = generator.integers(0, 250, (40, 70)).astype(kind)
    x = generator.uniform(-5, 75, (30, 8)).astype(np.float32)
    y = generator.uniform(-5, 45, (30, 8)).astype(np.float32)
    whole = remapped(image, x, y)
    monkeypatch.setattr(resampling, 'LARGEST', 32)
    monkeypatch.setattr(resampling, '_POINTS', 20)
    # Positions are rounded to a part of a pixel, in OpenCV 4 to 1/32.
    assert np.allclose(remapped(image, x, y), whole, atol=16)
    assert np.array_equal(remapped(image, np.stack([x, y], axis=-1), None), remapped(image, x, y))
    assert remapped(image, x, y).dtype == kind


@pytest.mark.parametrize('long', [True, False])
def test_a_side_may_be_40000_px_long(long: bool) -> None:
    ramp = np.tile(np.arange(40_000, dtype=np.uint16), (3, 1))
    places = np.array([[-2.0, 0.0, 32_765.5, 32_766.0, 32_767.5, 39_998.5, 41_000.0]], np.float32)
    across, down = (places, np.ones_like(places))
    if not long:
        ramp, across, down = np.ascontiguousarray(ramp.T), down, across
    expected = np.clip(places, 0, 39_999)
    assert np.abs(remapped(ramp, across, down) - expected).max() <= 0.5
    assert (
        remapped(ramp, np.zeros((40_000, 1), np.float32), np.zeros((40_000, 1), np.float32)).sum()
        == 0
    )
