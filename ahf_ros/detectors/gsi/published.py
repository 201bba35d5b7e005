"""Identification of GSI's targets as published: fixed thresholds, an invariant, an affine map.

The six steps of Wang et al. [1]_:

1. A fixed threshold makes the image binary.
2. Contours whose area, perimeter and roundness are those of a dot get a least-squares ellipse.
3. Every dot is taken together with the dots nearest to it, eight in all.
4. Three of the eight have to lie on a line, with three of the others on one side and two on the
   other.
5. The P2-invariant tells which of these five belong to the template.
6. An affine map from the template to the printed design puts the three other dots near positions.

It has no defence against uneven light, which makes it a fair test of a filter. The centre of a
target is that of the ellipse of its middle dot, with the perspective bias in it.

References
----------
.. [1] Wang et al., Remote Sens. 2022, 14, 5377.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.codes.gsi_library import point_family
from ahf_ros.detectors.claims import best_targets
from ahf_ros.detectors.contract import FamilyDetector
from ahf_ros.detectors.gsi.published_decoding import LARGEST_BIAS, Decoded, check_family, decode
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, DottedTarget, Target, sorted_targets

_FAMILY = 'gsi'  # whichever data file describes it
_THRESHOLD = 100  # gray value between dots and ground
_AREA = (30.0, 1000.0)  # of a dot, px
_PERIMETER = (20.0, 500.0)  # px
_MINIMUM_ROUNDNESS = 0.6  # 4 pi area / perimeter^2
_MINIMUM_POINTS = 14  # of a contour: neighbours are at most 2^0.5 px apart
_CONTOUR_ERROR = 0.2  # standard deviation of the centre of an ellipse, px


@dataclass(frozen=True, slots=True)
class PublishedGsiDetector(FamilyDetector):
    """The detector `gsi_published`; call it with an image.

    Attributes
    ----------
    settings : DetectorSettings

    Raises
    ------
    ValueError
        If the data file of the family is not accepted, or its template has not five dots A to E
        with C, E and A on a line.
    """

    name: ClassVar[str] = 'gsi_published'

    @property
    def design(self) -> PointFamily:
        """Printed design of the family, of those that the method can identify."""
        family = point_family(self.settings.family_file)
        check_family(family)
        return family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Of several targets that claim one ID the one that fits best keeps it, and the others are
        not reported.
        """
        check_image(image)
        settings, code = self.settings, self.design
        gray = as_gray(image)
        found: list[Target] = []
        single: list[Target] = []
        for polarity in settings.polarities:
            dots = find_dots(gray, polarity, settings.min_radius, settings.max_radius)
            decoded = decode(dots[:, :2], code)
            found += _targets(dots, decoded, polarity, code)
            if settings.report_undecoded:
                single += _undecoded(np.delete(dots, decoded.members, axis=0))
        return sorted_targets([*best_targets(found), *single])


def find_dots(gray: np.ndarray, polarity: int, min_radius: float, max_radius: float) -> np.ndarray:
    """Return the ellipses of dots: steps 1 and 2.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    polarity : int
        1 for dark dots, -1 for bright ones.
    min_radius, max_radius : float
        Bounds of the semi-major axis, px.

    Returns
    -------
    ndarray of float64, shape (k, 5)
        Centre x and y, semi-major and semi-minor axis, px, and direction, rad.
    """
    mask = (gray <= _THRESHOLD if polarity > 0 else gray > _THRESHOLD).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    ellipses = []
    for contour in contours:
        if not _MINIMUM_POINTS <= len(contour) <= _PERIMETER[1]:
            continue
        area, perimeter = cv2.contourArea(contour), cv2.arcLength(contour, closed=True)
        if (
            not _AREA[0] <= area <= _AREA[1]
            or not _PERIMETER[0] <= perimeter <= _PERIMETER[1]
            or 4 * np.pi * area < _MINIMUM_ROUNDNESS * perimeter**2
        ):
            continue
        (x, y), (first, second), angle = cv2.fitEllipse(contour)
        turned = np.deg2rad(angle + (90 if second > first else 0))
        # A contour runs through the centres of the outermost pixels, half a pixel inside.
        major, minor = (max(first, second) + 1) / 2, (min(first, second) + 1) / 2
        if min_radius <= major <= max_radius:
            ellipses.append((x, y, major, minor, (turned + np.pi / 2) % np.pi - np.pi / 2))
    return np.array(ellipses).reshape(-1, 5)


def _targets(
    dots: np.ndarray, decoded: Decoded, polarity: int, code: PointFamily
) -> list[DottedTarget]:
    """Return the targets of one polarity."""
    targets = []
    for word, members, bias in zip(decoded.words, decoded.members, decoded.bias, strict=True):
        x, y, major, minor, angle = dots[members[code.reference]].tolist()
        targets.append(
            DottedTarget(
                id=code.number(int(word)) or 0,
                code=int(word),
                x=x,
                y=y,
                semi_major=major,
                semi_minor=minor,
                angle=angle,
                covariance=(_CONTOUR_ERROR**2, 0.0, 0.0, _CONTOUR_ERROR**2),
                confidence=float(1 - bias / LARGEST_BIAS),
                family=_FAMILY,
                dots=tuple(map(tuple, dots[members].tolist())),
                template_dots=len(code.template),
                polarity=polarity,
            )
        )
    return targets


def _undecoded(dots: np.ndarray) -> list[Target]:
    """Return the dots that belong to no target."""
    spread = (_CONTOUR_ERROR**2, 0.0, 0.0, _CONTOUR_ERROR**2)
    return [
        Target(UNDECODED, 0, x, y, major, minor, angle, covariance=spread)
        for x, y, major, minor, angle in dots.tolist()
    ]
