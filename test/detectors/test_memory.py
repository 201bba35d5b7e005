"""Large images fit into little memory: what is measured a pixel of a smaller one."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from ahf_ros import create_identifier
from ahf_ros.features import candidates, small_dots
from ahf_ros.imaging.image import as_gray
from support.scenes import rendering

MAXIMUM_BYTES = 24.0
"""A pixel, of an image with 16 bits, which takes two of them."""


def peak_of(work) -> int:
    """Return the most memory that arrays take at a time, bytes."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_an_image_with_16_bits_takes_24_bytes_a_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    # Parts as small beside this image as they are beside one of 100 MP.
    for module, name in ((candidates, '_MOST_CELLS'), (small_dots, '_STRIP')):
        monkeypatch.setattr(module, name, getattr(module, name) // 32)
    shown = rendering(width=2000, height=1500, targets=4, light='stripe', ambient=0.3, seed=5)
    image = shown.image.astype(np.uint16) * 200
    identifier = create_identifier(family='metashape12', threads=1)
    identifier.identify(image[:600, :800])  # modules are imported, tables made
    found = []
    peak = peak_of(lambda: found.append(identifier.identify(image.copy())))
    assert len(found[0].targets) == 4
    assert peak < MAXIMUM_BYTES * image.size


def test_gray_values_of_16_bits_are_scaled_without_copies() -> None:
    image = np.arange(2**20, dtype=np.uint16).reshape(1024, 1024)
    assert peak_of(lambda: as_gray(image)) < 4.6 * image.size + image.nbytes
    share = image.astype(np.float32) / np.float32(np.sort(image, axis=None)[-11])
    assert np.array_equal(as_gray(image), np.minimum(255 * share, 255))
