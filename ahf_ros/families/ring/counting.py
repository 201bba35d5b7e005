"""Estimation of the number of coded targets in an image.

Dots are found and read as the detector `ring` does. A dot counts where a word says far more than
no target at all, whichever of several words it is, so that a target also counts where its band is
partly hidden.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ahf_ros.families.claims import owners
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.ring.confidence import features, target_probability
from ahf_ros.families.ring.contests import on_targets
from ahf_ros.families.ring.decoding import CLEAR
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.families.ring.hypotheses import CERTAIN
from ahf_ros.vision import frame
from ahf_ros.vision.image import as_gray, check_image

_OF_WORDS = 0.5  # of what speaks against a word, which counts against a target


def estimate_count(image: np.ndarray, settings: DetectorSettings) -> int:
    """Estimate how many coded targets an image shows.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        As received.
    settings : DetectorSettings
        Families of rings, colour and sizes of the targets.

    Returns
    -------
    int
        At least 0; the same for the same image.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """
    check_image(image)
    read = find_hypotheses(as_gray(image), settings)
    major, _, _ = frame.ellipse_axes(read.frames)
    minimum, maximum = settings.radii
    # Which of several words it is does not matter here.
    no_doubt = np.full(len(read.words), CLEAR)
    clear = replace(read, margin=no_doubt, coded=_OF_WORDS * read.coded)
    probability = np.where(read.words > 0, target_probability(features(clear)), 0.0)
    counted = (probability >= CERTAIN) & (major >= minimum) & (major <= maximum)
    order = np.argsort(-read.seen[counted], kind='stable')
    targets = read.select(np.flatnonzero(counted)[order])
    certain = np.ones(len(order), bool)
    return int(owners(len(order), on_targets(targets, certain)).sum())
