"""Frames of certain targets, measured anew where their edges tell more than in the first reading.

A large dot is read where it has few pixels. Its edges are as sharp in the image as those of small
ones, so that its centre is measured there: from half to half, each of which doubles the error of
the frame to a small part of a pixel. Soft edges are measured again on profiles that are long
enough for them: a sharper step is fitted to a part of an edge, at the wrong place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.families.ring.circles import reach_of, target_circles
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.reading import PER_SECTOR
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import ENOUGH, SOFT, fit_circles_of_any_blur
from ahf_ros.vision.profiles import BLURS


def at_full_size(images: Sequence[np.ndarray], read: Hypotheses) -> Hypotheses:
    """Return hypotheses in px of an image, those of certain words with frames from its edges.

    `images` are the image and its halves, down to the one in whose px the targets were read.
    """
    read = with_soft_edges(images[-1], read, read.certain)
    for image in reversed(images[:-1]):
        read = replace(
            read,
            frames=frame.enlarged(read.frames, 1),
            covariance=4 * read.covariance,
            blur=2 * read.blur,
            edge_shift=2 * read.edge_shift,
        )
        # Where edges are soft in a half, the image has no sharper ones.
        read = _measured(image, read, read.certain & (read.blur < BLURS[1]))
    return read


def with_soft_edges(image: np.ndarray, read: Hypotheses, right: np.ndarray) -> Hypotheses:
    """Return hypotheses, those of right words with soft edges with frames from all of these."""
    return _measured(image, read, right & (read.blur > SOFT))


def _measured(image: np.ndarray, read: Hypotheses, which: np.ndarray) -> Hypotheses:
    """Return hypotheses, some with frames from the edges of an image, if it shows them."""
    selected = np.flatnonzero(which)
    if not selected.size:
        return read
    gray = image.astype(np.float32, copy=False)
    for code in dict.fromkeys(read.families[selected]):
        of_code = selected[read.families[selected] == code]
        some = read.select(of_code)
        circles = target_circles(some.words, some.starts, some.polarity, PER_SECTOR, code)
        fit = fit_circles_of_any_blur(
            gray, some.frames, circles, reach=reach_of(code), projective=True
        )
        fitted = replace(
            some,
            frames=fit.frames,
            covariance=fit.covariance,
            share=fit.share,
            blur=fit.blur,
            edge_shift=fit.edge_shift,
            contrast=fit.contrast,
        )
        good = fit.share >= ENOUGH
        read = read.replaced(of_code[good], fitted.select(good))
    return read
