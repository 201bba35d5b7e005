"""Frames at full size of targets that were read in a half of the image.

A large dot is read where it has few pixels. Its edges are as sharp in the image as those of small
ones, so that its centre is measured there: from half to half, each of which doubles the error of
the frame to a small part of a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.detectors.ring.reading import PASSES
from ahf_ros.detectors.ring.target_circles import REACH, target_circles
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import fit_circles

_MINIMUM_SHARE = 0.5  # of the expected edges, for a fit to count
_FARTHEST = 2.0  # that a centre is moved, px


def at_full_size(images: Sequence[np.ndarray], read: Hypotheses) -> Hypotheses:
    """Return hypotheses in px of an image, those of certain words with frames from its edges.

    Parameters
    ----------
    images : sequence of ndarray of uint8 or float32
        The image and its halves, without the last one, in which the targets were read.
    read : Hypotheses
        In px of that last half.
    """
    for image in reversed(images):
        read = replace(read, frames=frame.enlarged(read.frames, 1), covariance=4 * read.covariance)
        certain = np.flatnonzero(read.certain)
        if not certain.size:
            continue
        gray = image.astype(np.float32, copy=False)
        for code in dict.fromkeys(read.families[certain]):
            which = certain[read.families[certain] == code]
            read = read.replaced(which, _fitted(gray, read.select(which), code))
    return read


def _fitted(gray: np.ndarray, read: Hypotheses, code: Family) -> Hypotheses:
    """Return hypotheses of one family with frames from the edges of an image, if it shows them."""
    per_sector, rounds = PASSES[-1]
    circles = target_circles(read.words, read.starts, read.polarity, per_sector, code)
    fit = fit_circles(gray, read.frames, circles, reach=REACH, projective=True, rounds=rounds)
    moved = np.hypot(*(fit.frames[:, :2, 2] - read.frames[:, :2, 2]).T)
    good = (fit.share >= _MINIMUM_SHARE) & (moved <= _FARTHEST)
    better = replace(read, frames=fit.frames, covariance=fit.covariance, share=fit.share)
    return read.replaced(good, better.select(good))
