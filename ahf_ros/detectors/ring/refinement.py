"""Sub-pixel centres in the image as received, of targets that were found in another image.

A filter that makes targets readable moves their edges: it changes gray values next to an edge by
what lies beyond it. Identification may come from the filtered image, places should not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring import decoding
from ahf_ros.detectors.ring.reading import PASSES, REACH, read_dots
from ahf_ros.features import circle_fit, frame
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target

_FIRST_RAYS, _RAYS = 24, 48  # about a dot, for its sign and a first frame, and for its place
_LEAST_SHARE = 0.5  # of the expected edges, for a fit to count
_FARTHEST, _FARTHEST_SHARE = 1.0, 0.2  # that a centre is moved: px, or radii of its dot


def refine_centres(
    image: np.ndarray, targets: Sequence[Target], code: Family, signs: Sequence[int] = (1, -1)
) -> list[Target]:
    """Return targets with places, ellipses and covariances from the edges in an image.

    Dot and band give the image of the physical centre where the band of a target can be read and
    says what `Target.code` does; elsewhere the dot gives the centre of its ellipse. A target whose
    edge is not found near to where it should be stays as it is. No ID changes.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        The image as received.
    targets : sequence of Target
        To about a pixel.
    code : Family
    signs : sequence of int
        What is possible: 1 for a dark dot on bright, -1 for a bright one on dark.

    Returns
    -------
    list of Target
        In the order of `targets`.

    Raises
    ------
    ValueError
        If `image` is not an image, see `ahf_ros.imaging.image.check_image`.
    """
    check_image(image)
    if not targets:
        return []
    gray = as_gray(image).astype(np.float32, copy=False)
    columns = [(it.x, it.y, it.semi_major, it.semi_minor, it.angle) for it in targets]
    start = frame.affine_frames(*np.array(columns).T)
    frames, covariance, share = _fitted(gray, start, targets, code, signs)
    axes = np.stack(frame.ellipse_axes(frames), axis=1)
    moved = np.hypot(*(frames[:, :2, 2] - start[:, :2, 2]).T)
    reach = np.maximum(_FARTHEST, _FARTHEST_SHARE * frame.ellipse_axes(start)[1])
    good = (share >= _LEAST_SHARE) & (moved <= reach)
    return [
        _moved(target, *of_target) if is_good else target
        for target, is_good, *of_target in zip(
            targets, good, frames[:, :2, 2], axes, covariance, strict=True
        )
    ]


def _fitted(
    gray: np.ndarray,
    start: np.ndarray,
    targets: Sequence[Target],
    code: Family,
    signs: Sequence[int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frames, covariances and shares of edges, by dot and band where the band agrees."""
    dots, dot_signs = _fitted_dots(gray, start, signs)
    decoded = np.array([target.id != UNDECODED for target in targets])
    decoded = np.flatnonzero(decoded & (dots.share >= _LEAST_SHARE))
    found, of_decoded = read_dots(
        gray, dots.chosen(decoded), dot_signs[decoded], code, passes=PASSES[-1:]
    )
    codes, _ = decoding.canonical(found.words, code)
    which = decoded[of_decoded]
    agreed = (found.words > 0) & (codes == np.array([target.code for target in targets])[which])
    agreed &= found.share >= _LEAST_SHARE
    # Of two that agree on one target, the one with the larger margin is written last.
    best = np.flatnonzero(agreed)[np.argsort(found.margin[agreed], kind='stable')]
    rest = np.setdiff1d(np.arange(len(targets)), which[best])
    circles = circle_fit.dot_circles(dot_signs[rest], _RAYS)
    alone = circle_fit.fit_circles(gray, start[rest], circles, reach=REACH, projective=False)
    frames, covariance, share = dots.frames, dots.covariance, dots.share
    for these, of in ((rest, alone), (which[best], found.chosen(best))):
        frames[these], covariance[these], share[these] = of.frames, of.covariance, of.share
    return frames, covariance, share


def _fitted_dots(
    gray: np.ndarray, frames: np.ndarray, signs: Sequence[int]
) -> tuple[circle_fit.Fit, np.ndarray]:
    """Return first fits of dots, with the sign of each that its edge has."""
    fits = [
        circle_fit.fit_circles(
            gray,
            frames,
            circle_fit.dot_circles(np.full(len(frames), sign), _FIRST_RAYS),
            reach=REACH,
            projective=False,
            rounds=1,
        )
        for sign in signs
    ]
    # Of the wrong sign there are edges, too, within what is flat; but they are faint.
    best = np.argmax([fit.share * (1 - fit.contrast) for fit in fits], axis=0)
    every = circle_fit.Fit.joined(fits)
    return every.chosen(best * len(frames) + np.arange(len(frames))), np.array(signs)[best]


def _moved(target: Target, centre: np.ndarray, axes: np.ndarray, covariance: np.ndarray) -> Target:
    return replace(
        target,
        x=float(centre[0]),
        y=float(centre[1]),
        semi_major=float(axes[0]),
        semi_minor=float(axes[1]),
        angle=float(axes[2]),
        covariance=tuple(covariance.ravel().tolist()),
    )
