"""Estimation of the number of coded targets in an image.

Dots are found as the detector `ring` finds them. Their surroundings tell which of them are centres
of targets. No word is decoded, so that a target also counts where its band is partly hidden or too
dark.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.ring import family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.detector import find_hypotheses
from ahf_ros.detectors.ring.hypotheses import resolve_dots
#from ahf_ros.detectors.ring.surroundings import designs, likely_targets
from ahf_ros.features import frame
from ahf_ros.imaging.image import as_gray, check_image

_COUNTED = 0.75  # probability of being a target, from which a dot counts


def estimate_count(image: np.ndarray, settings: DetectorSettings | None = None) -> int:
    """Estimate how many coded targets an image shows.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        As received.
    settings : DetectorSettings, optional
        Proportions, colour and sizes of the targets; the defaults where None.

    Returns
    -------
    int
        At least 0; the same for the same image.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """
    settings = settings or DetectorSettings()
    check_image(image)
    gray = as_gray(image)
    dots = find_hypotheses(gray, settings)
    major, _, _ = frame.ellipse_axes(dots.frames)
    minimum, maximum = settings.radii
    dots = dots.select((major >= minimum) & (major <= maximum))
    gray = gray.astype(np.float32, copy=False)
    prints = designs([family(name) for name in settings.families])
    of_prints = np.array([likely_targets(gray, dots, code) for code in prints])
    which, probability = of_prints.argmax(axis=0), of_prints.max(axis=0)
    best_first = np.argsort(-probability, kind='stable')
    order = best_first[probability[best_first] >= _COUNTED]
    reach = np.array([code.band_outer for code in prints])[which[order]]
    count = len(order)
    targets = dots.select(order)
    reach *= frame.ellipse_axes(targets.frames)[1]
    distinct, _ = resolve_dots(targets, np.zeros(count), np.ones(count, bool), reach)
    return len(distinct)
