"""Large images fit into little memory: what is measured a pixel of a smaller one."""

import tracemalloc
from typing import Any

import numpy as np
import pytest

from ahf_ros import create_identifier
from ahf_ros.vision import candidates, log_edges, small_dots
from ahf_ros.vision.image import as_gray
from support.scenes import rendering


def peak_of(work: Any) -> int:
    """Return the most memory that arrays take at a time, bytes."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ('family', 'bits', 'most'), [('metashape12', 16, 14.5), ('metashape12,cctag3', 8, 16.0)]
)
def test_a_pixel_takes_so_many_bytes(
    family: str, bits: int, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Parts as small beside this image as they are beside one of 100 MP.
    for module, name in (
        (candidates, '_MOST_CELLS'),
        (log_edges, '_BAND'),
        (small_dots, '_STRIP'),
    ):
        monkeypatch.setattr(module, name, getattr(module, name) // 32)
    shown = rendering(width=2000, height=1500, targets=4, light='stripe', ambient=0.3, seed=5)
    image = shown.image if bits == 8 else shown.image.astype(np.uint16) * 200
    identifier = create_identifier(family=family, threads=1)
    identifier.identify(image[:600, :800])  # modules are imported, tables made
    found = []
    peak = peak_of(lambda: found.append(identifier.identify(image.copy())))
    assert len(found[0].targets) == 4
    assert peak < most * image.size


def test_gray_values_of_16_bits_are_scaled_without_copies() -> None:
    image = np.arange(2**20, dtype=np.uint16).reshape(1024, 1024)
    assert peak_of(lambda: as_gray(image)) < 4.6 * image.size + image.nbytes
    share = image.astype(np.float32) / np.float32(np.sort(image, axis=None)[-11])
    assert np.array_equal(as_gray(image), np.minimum(255 * share, 255))
