"""The bands about dots read, and dot and band refined together."""

from __future__ import annotations

import numpy as np

from ahf_ros import decoding, evidence, frame, subpixel
from ahf_ros.codes.ring import Family
from ahf_ros.hypotheses import Hypotheses

REACH = 0.45
"""Distance from an expected edge to look for it, dot radii."""

_RAYS = 48  # about a dot
_READINGS = ((5, 1), (10, 2))  # of a band: samples a sector, and rounds of the fit that follows
_SHIFT = 0.4  # of an edge towards the dark side, px, at the most
_SMALL = 7.0  # radius of dots that such a shift spoils the reading of, px


def read_dots(
    gray: np.ndarray, fit: subpixel.Fit, signs: np.ndarray, code: Family
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

    Returns
    -------
    found : Hypotheses
        One of each dot, then a second one of each small dot.
    which : ndarray of int, shape (m,)
        The dot that each is of.
    """
    which, frames = _unshifted(fit, signs)
    fit = fit.chosen(which)
    marks = evidence.Marks(signs[which], fit.contrast, fit.bright)
    found = Hypotheses.unread(fit)
    read = np.arange(len(which))
    # A band that was read right makes the frame better, and a better frame the reading.
    for samples, rounds in _READINGS:
        readings = decoding.read_bands(gray, frames, marks, code, samples)
        good = readings.plausible
        read, readings, marks = read[good], readings.chosen(good), marks.chosen(good)
        circles = subpixel.ring_circles(
            readings.words, readings.start, marks.signs, _RAYS, samples, code
        )
        fit = subpixel.fit_circles(
            gray, frames[good], circles, reach=REACH, projective=True, rounds=rounds
        )
        frames = fit.frames
    found.update(read, readings, fit)
    return found, which


def _unshifted(fit: subpixel.Fit, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which dots to read, and their frames without the shift of the dot's edge.

    A camera's gamma makes a dark dot smaller and a bright one larger, by a third of a pixel at
    usual blur; a linear camera does not. The band, up to 3.5 radii away, needs the scale: small
    dots are read with either, others with the mean.
    """
    major, minor, _ = frame.ellipse_axes(fit.frames)
    size = np.sqrt(major * minor)
    every, small = np.arange(len(size)), np.flatnonzero(size < _SMALL)
    which = np.concatenate([every, small])
    shift = np.full(len(size), _SHIFT / 2)
    shift[small] = 0.0
    shift = np.concatenate([shift, np.full(len(small), _SHIFT)])
    changes = np.zeros((len(which), 5))
    changes[:, 2] = signs[which] * shift / size[which]
    return which, frame.moved(fit.frames[which], changes)
