"""The bands about dots read, and dot and band refined together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring import decoding, evidence
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.features import circle_fit, frame

REACH = 0.45
"""Distance from an expected edge to look for it, dot radii."""

PASSES = ((5, 1), (10, 2))
"""Over a band, each in a better frame: samples a sector, and rounds of the fit that follows."""

_RAYS = 48  # about a dot
_LEVELS = (0.75, 1.4)  # dot radii, where the levels of dot and gap are read
_LEVEL_RAYS = 24
_PRINTED = 0.25  # usual contrast of prints
_SHIFT = 0.5  # of an edge towards the dark side, in its blur, at the most
_SMALL = 7.0  # radius of dots that such a shift spoils the reading of, px


def read_dots(
    gray: np.ndarray,
    fit: circle_fit.Fit,
    signs: np.ndarray,
    code: Family,
    passes: Sequence[tuple[int, int]] = PASSES,
) -> tuple[Hypotheses, np.ndarray]:
    """Read the bands about dots, and refine dot and band together.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    fit : Fit
        Of k dots.
    signs : ndarray of int, shape (k,)
        1 for a dark target, -1 for a bright one.
    code : Family
    passes : sequence of (int, int)
        As `PASSES` has them; one is enough where frames are right to a tenth of a pixel.

    Returns
    -------
    found : Hypotheses
        One of each dot, then a second one of each small dot.
    which : ndarray of int, shape (m,)
        The dot that each is of.
    """
    which, frames = _unshifted(fit, signs)
    fit = fit.chosen(which)
    contrast = _contrast(gray, fit, signs[which])
    marks = evidence.Marks(signs[which], contrast, fit.bright, fit.blur)
    found = Hypotheses.unread(fit)
    read = np.arange(len(which))
    # A band that was read right makes the frame better, and a better frame the reading.
    for samples, rounds in passes:
        readings = decoding.read_bands(gray, frames, marks, code, samples)
        good = readings.plausible
        read, readings, marks = read[good], readings.chosen(good), marks.chosen(good)
        circles = circle_fit.ring_circles(
            readings.words, readings.start, marks.signs, _RAYS, samples, code
        )
        fit = circle_fit.fit_circles(
            gray, frames[good], circles, reach=REACH, projective=True, rounds=rounds
        )
        frames = fit.frames
    found.update(read, readings, fit)
    return found, which


def _contrast(gray: np.ndarray, fit: circle_fit.Fit, signs: np.ndarray) -> np.ndarray:
    """Return the contrast that marks are expected to have.

    It is that of the dot's edge. Where a camera sharpens, that edge is darker than marks are, and
    where marks are small blur makes them less dark. The levels beside the edge then tell more; at
    large dots only up to the usual contrast of prints, because the light may change between them.
    """
    angles = 2 * np.pi * np.arange(_LEVEL_RAYS) / _LEVEL_RAYS
    values = frame.sample_circles(gray, fit.frames, angles, np.array(_LEVELS))
    inside, outside = np.moveaxis(np.maximum(values, 1.0), 2, 0)
    ratio = np.median(inside / outside, axis=1) ** signs
    small = frame.mean_radii(fit.frames) < _SMALL
    return np.maximum(fit.contrast, np.where(small, ratio, np.minimum(ratio, _PRINTED)))


def _unshifted(fit: circle_fit.Fit, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which dots to read, and their frames without the shift of the dot's edge.

    A camera's gamma makes a dark dot smaller and a bright one larger, by up to half of the
    standard deviation of the blur; a linear camera does not. The band, up to 3.5 radii away, needs
    the scale: small dots are read with either, others with the mean.
    """
    size = frame.mean_radii(fit.frames)
    every, small = np.arange(len(size)), np.flatnonzero(size < _SMALL)
    which = np.concatenate([every, small])
    share = np.full(len(size), 0.5)
    share[small] = 0.0
    share = np.concatenate([share, np.ones(len(small))])
    changes = np.zeros((len(which), 5))
    changes[:, 2] = signs[which] * _SHIFT * share * fit.blur[which] / size[which]
    return which, frame.moved(fit.frames[which], changes)
