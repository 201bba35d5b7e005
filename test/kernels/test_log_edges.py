"""Edges that run straight on, against Scharr's operator on the whole image."""

import cv2
import numpy as np
import pytest

from ahf_ros import kernels

CONTINUED, STRAIGHT = 0.5, 0.94


@pytest.mark.parametrize('seed', range(8))
def test_bent_edges_have_another_gradient_along_themselves(seed: int) -> None:
    generator = np.random.default_rng(seed)
    tall, wide = [(1, 30), (30, 1), (12, 9), (40, 50)][seed % 4]
    log = generator.integers(-1500, 1500, (tall, wide)).astype(np.int16)
    if seed > 3:  # where most run straight on
        smooth = cv2.GaussianBlur(log, (0, 0), 9.0)
        log = cv2.normalize(smooth, None, -1500, 1500, cv2.NORM_MINMAX).astype(np.int16)
    across, down = (
        np.rint(cv2.Scharr(log.astype(float), cv2.CV_64F, *of) / 32) for of in ((1, 0), (0, 1))
    )
    strength = np.hypot(across, down)
    y, x = np.nonzero(strength > 0)
    strength, length = strength[y, x].astype(np.float32), [3.0, 7.4][seed % 2]
    unit_x, unit_y = (of[y, x].astype(np.float32) / strength for of in (across, down))
    columns, rows = np.int32(x), np.int32(y)
    given = log, columns, rows, unit_x, unit_y, strength, 1 / 32, length, CONTINUED, STRAIGHT
    bent, expected = kernels.bent_edges(*given), []
    for column, row, *unit, size in zip(x, y, unit_x, unit_y, strength, strict=True):
        straight = True
        for way in (length, -length):
            at_x = int(np.clip(np.rint(np.float32(column - way * unit[1])), 0, wide - 1))
            at_y = int(np.clip(np.rint(np.float32(row + way * unit[0])), 0, tall - 1))
            gradient = np.array([across[at_y, at_x], down[at_y, at_x]])
            along = gradient @ unit
            straight &= bool(along > CONTINUED * size)
            straight &= bool(along**2 > STRAIGHT * (gradient**2).sum())
        expected.append(not straight)
    # Single precision rounds a place, or a gradient, to another whole number now and then.
    assert (bent != np.array(expected, bool)).mean() <= 0.005
    assert seed <= 3 or not bent.all()
    wild = [np.full(len(x), value, np.float32) for value in (np.nan, np.inf, 1e30)]
    kernels.bent_edges(log, columns * 9, rows - 70, *wild, np.inf, np.nan, CONTINUED, STRAIGHT)
