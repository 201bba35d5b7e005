"""Prints laid over images, against plain sums and against what was drawn."""

import math

import numpy as np
import pytest

from ahf_ros import kernels

CELLS = 4
PLACES = np.linspace(-0.65, 0.65, 22)
OF_CELLS = np.clip(np.floor((PLACES + 0.5) * CELLS), -1, CELLS).astype(np.int32) + 1
NUMBERS = 0.5 / CELLS, 0.02, 4.0, 1.4826, 0.3, 0.25, 0.7, 1e-6
FRAME = np.array([[33.0, 4, 40], [-3, 30, 41], [0.05, -0.04, 1]])
LEVELS = np.array([180.0, 8, -5, -140, 6, 4, 0])  # of paper and its slopes, and of the step
BLUR = 0.03


def below(away: float) -> float:
    return (1 + math.erf(away / math.sqrt(2))) / 2


def inked(ink: np.ndarray, x: float, y: float) -> float:
    """Return how much of a blurred place is ink."""
    edges = np.linspace(-0.5, 0.5, len(ink) + 1)
    across, down = (
        np.diff([-below((at - edge) / BLUR) for edge in edges.tolist()]) for at in (x, y)
    )
    return float(down @ ink @ across)


def drawn(ink: np.ndarray) -> np.ndarray:
    """Return an image of a print in which gray values are those of the middles of pixels."""
    gray, to_plane = np.empty((80, 81), np.float32), np.linalg.inv(FRAME)
    for row, column in np.ndindex(gray.shape):
        x, y, scale = to_plane @ [column, row, 1]
        terms = [1, x / scale, y / scale]
        shown = inked(ink, x / scale, y / scale)
        gray[row, column] = LEVELS[:3] @ terms + shown * (LEVELS[3:6] @ terms)
    return gray


def laid(gray: np.ndarray, start: np.ndarray, ink: np.ndarray, inner: float = -1.0) -> tuple:
    blurs = np.tile([0.04, 0.01, 0.25], (len(start), 1))
    of_print = ink, PLACES, OF_CELLS, blurs, inner
    return kernels.laid_prints(gray, start, *of_print, *NUMBERS, 10, g=CELLS + 2)[:4]


@pytest.mark.parametrize('whole', [True, False])
def test_prints_are_found_where_they_are(whole: bool) -> None:
    generator = np.random.default_rng(2)
    ink = generator.random((CELLS, CELLS)) < 0.6
    ink[[0, -1]] = ink[:, [0, -1]] = True
    start = np.tile(FRAME, (8, 1, 1))
    start[:, :2] += generator.normal(0, 0.7, (8, 2, 3))
    gray = drawn(ink)
    prints = np.tile(ink if whole else np.ones((1, 1), bool), (8, 1, 1))
    frames, unknowns, shares, covariance = laid(gray, start, prints, -1.0 if whole else 0.45)
    assert (shares > 0.95).all()
    # Interpolation between pixels, and a last step of 0.02 px, move little.
    np.testing.assert_allclose(frames[:, :2, 2], np.tile(FRAME[:2, 2], (8, 1)), atol=0.06)
    np.testing.assert_allclose(frames, np.tile(FRAME, (8, 1, 1)), atol=0.2)
    if whole:
        np.testing.assert_allclose(unknowns[:, 9:15], np.tile(LEVELS[:6], (8, 1)), atol=2.0)
        assert np.linalg.eigvalsh(covariance).min() > 0


def test_what_is_no_print_does_not_settle() -> None:
    generator = np.random.default_rng(3)
    gray = generator.uniform(0, 255, (80, 81)).astype(np.float32)
    ink = np.ones((2, CELLS, CELLS), bool)
    away = FRAME + np.outer([300, 0, 0], [0, 0, 1])
    assert (laid(gray, np.array([FRAME, away]), ink)[2] < 0.7).all()


@pytest.mark.parametrize('bad', [0.0, math.nan, math.inf, 1e300])
def test_bad_values_end(bad: float) -> None:
    gray = np.full((1, 1), np.clip(bad, 0, 1e38), np.float32)
    laid(gray, np.full((2, 3, 3), bad), np.zeros((2, CELLS, CELLS), bool))
    laid(gray, np.array([FRAME]), np.ones((1, 1, 1), bool), bad)
