"""Identification of concentric circles by the profile of their rings.

Any of the circles may be found as a dot. Whichever it is, the mean profile along its radius tells:
each ray is divided by its own light, and what is left is a straight line but for the ink. The rings
of the right ID, blurred and shifted as edges are, explain most of it. Then all circles together
give the frame, whose origin is the image of the common centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.codes.cctag import CircleFamily, circle_family
from ahf_ros.detectors.claims import best_targets
from ahf_ros.detectors.contract import FamilyDetector
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circle_fit import ENOUGH, Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots
from ahf_ros.features.dots import Dots
from ahf_ros.features.ellipse_targets import targets_from_frames
from ahf_ros.features.log_edges import find_edges
from ahf_ros.features.logistic import logistic
from ahf_ros.features.outlines import whole_outlines
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.features.robust import NORMAL
from ahf_ros.features.sampling import sample_circles
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import Target, sorted_targets

_RAYS = 48  # about a circle
_PROFILE = np.linspace(0.08, 1.3, 90)  # radii at which rays are read
_ANGLES = 2 * np.pi * np.arange(96) / 96
_SHIFTS = np.arange(-1.5, 1.51, 0.25)  # of edges, that are tried, px
_BLURS = (0.5, 0.7, 1.0, 1.4, 2.0)  # the same of their standard deviation
_SIZES = 1.04  # ratio of radii that share templates
_FAINT = (0.08, 0.12)  # steps of ln of edges of rings that blur makes gray
_PROMISING = 0.5  # share of a profile that an ID explains, from which its circles are fitted
_ROUNDS = 3  # of Gauss-Newton
_OUTLIER = 3.0  # standard deviations, that quarter the weight of a reading
_MAXIMUM_CHANGE = 0.1  # of a frame in a round, radii
_INDEPENDENT = 1.0  # area of independent readings, px^2
_SYSTEMATIC = 0.003  # px
_CERTAIN = 0.75  # confidence
_CORRELATION = 1.5  # distance of independent readings along the profile, px
_OF_TARGET = np.array([-40.0, 24.0, 30.0])  # of one, rays that agree, explained share
_OF_ID = np.array([-1.0, 2.0])  # of one, margin
_PROMISING_RAYS = 0.3
_AGREEING = 0.5  # share of what a ray shows, that the rings explain


@dataclass(frozen=True, slots=True)
class Readings(ArrayRecord):
    """What the profiles of k circles are read as: IDs, and how much of the profile they explain."""

    ids: np.ndarray
    explained: np.ndarray
    margin: np.ndarray
    shift: np.ndarray
    blur: np.ndarray


def read_profiles(
    gray: np.ndarray, frames: np.ndarray, family: CircleFamily, polarity: int
) -> Readings:
    """Return the IDs whose rings explain most of the profiles of outermost circles."""
    values = np.maximum(sample_circles(gray, frames, _ANGLES, _PROFILE), 0)
    values /= np.maximum(values.mean(axis=2, keepdims=True), 1)
    weight = np.sqrt(_PROFILE / _PROFILE.sum())
    profiles = values.mean(axis=1) * (weight * polarity)
    line, _ = np.linalg.qr(np.stack([weight, _PROFILE * weight], axis=1))
    profiles -= (profiles @ line) @ line.T
    size = frame.mean_radii(frames)
    steps = np.rint(np.log(np.maximum(size, 1)) / np.log(_SIZES)).astype(int)
    count = len(family.numbers)
    explained = np.zeros((len(frames), count))
    edges = np.zeros((len(frames), count, 2))
    total = np.maximum((profiles**2).sum(axis=1), 1e-12)[:, None]
    for step in np.unique(steps):
        some = np.flatnonzero(steps == step)
        templates, of_edges = _templates(family, int(step))
        along = np.minimum(profiles[some] @ templates.T, 0)  # ink is darker
        share = (along**2 / total[some]).reshape(len(some), -1, count)
        best = share.argmax(axis=1)
        explained[some] = np.take_along_axis(share, best[:, None], axis=1)[:, 0]
        edges[some] = of_edges[best]
    order = np.argsort(-explained, axis=1, kind='stable')
    rows = np.arange(len(frames))
    first, second = (explained[rows, order[:, place]] for place in (0, 1))
    independent = size * np.ptp(_PROFILE) / _CORRELATION
    margin = 0.5 * independent * np.log((1 - second) / np.maximum(1 - first, 1e-6))
    return Readings(order[:, 0], first, margin, *edges[rows, order[:, 0]].T)


@lru_cache(maxsize=256)
def _templates(family: CircleFamily, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return unit profiles of all IDs under shifts and blurs, and these shifts."""
    size = _SIZES**step
    weight = np.sqrt(_PROFILE / _PROFILE.sum())
    line, _ = np.linalg.qr(np.stack([weight, _PROFILE * weight], axis=1))
    radii = family.radii(np.array(family.numbers))
    sign = np.where(np.arange(radii.shape[1]) % 2 == 0, 1, -1)
    found, of_edges = [], []
    for shift, blur in product(_SHIFTS, _BLURS):
        if abs(shift) > 0.5 * family.narrow * size and shift:
            continue
        edges = (radii * (size - shift) + sign * shift) / size
        ink = (sign[:, None] * _normal_share((edges[..., None] - _PROFILE) * (size / blur))).sum(1)
        ink *= weight
        ink -= (ink @ line) @ line.T
        found.append(ink / np.linalg.norm(ink, axis=1, keepdims=True))
        of_edges.append((shift, blur))
    return np.concatenate(found), np.array(of_edges)


def _normal_share(x: np.ndarray) -> np.ndarray:
    """Return the share of a normal distribution below x, to 0.0005 (Page, JRSS C 1977, 26, 75)."""
    return 0.5 * (1 + np.tanh(np.sqrt(2 / np.pi) * (x + 0.044715 * x**3)))


@dataclass(frozen=True, slots=True)
class CctagDetector(FamilyDetector):
    """Identify targets of concentric circles.

    Attributes
    ----------
    settings : DetectorSettings
    """

    @property
    def name(self) -> str:
        """Name in the registry."""
        return 'cctag'

    @property
    def design(self) -> CircleFamily:
        """Printed design of the family."""
        return circle_family(self.settings.family)

    @one_blas_thread()
    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        check_image(image)
        gray = as_gray(image)
        found = [
            target
            for polarity in self.settings.polarities
            for target in _identified(gray, self.design, self.settings.radii, polarity)
        ]
        return sorted_targets(best_targets(found, 1.0))


def _identified(
    gray: np.ndarray, family: CircleFamily, radii: tuple[float, float], polarity: int
) -> list[Target]:
    """Return the targets of one colour."""
    image = gray.astype(np.float32, copy=False)
    circles = _found_circles(gray, radii)
    outermost = _outermost(circles, family, radii, polarity)
    first = read_profiles(image, outermost, family, polarity)
    kept = _best_of_places(outermost, first.explained)
    if not kept.size:
        return []
    frames = outermost[kept]
    frames = frames[
        _agreeing(image, frames, first.select(kept), family, polarity) > _PROMISING_RAYS
    ]
    if not len(frames):
        return []
    for _ in range(2):
        read = read_profiles(image, frames, family, polarity)
        frames, covariance, shift = _aligned(image, frames, read, family, polarity)
    read = read_profiles(image, frames, family, polarity)
    rays = _agreeing(image, frames, read, family, polarity)
    confidence = logistic(np.stack([rays, read.explained], axis=1), _OF_TARGET)
    confidence *= logistic(read.margin[:, None], _OF_ID)
    good = confidence > _CERTAIN
    ids = read.ids[good]
    return targets_from_frames(
        frames[good], covariance[good], ids, ids, confidence[good], family.name, shift[good]
    )


def _found_circles(gray: np.ndarray, radii: tuple[float, float]) -> Fit:
    """Return circles of an image that may be some of a target's."""
    pyramid = image_pyramid(gray, radii[1])
    found = [voted_dots(pyramid, radii[0] / 3, min(radii[1], 60.0), (1, -1))]
    for level, log in enumerate(pyramid.logs):
        edges = find_edges(log, *_FAINT)
        dots = whole_outlines(edges, max(radii[0] / 3 / 2**level, 2.0), radii[1] / 2**level)
        found.append(replace(dots, frames=frame.enlarged(dots.frames, level)))
    dots = Dots.joined(found)
    fit = fit_dots(pyramid.gray, dots.frames, dots.polarity, rays=_RAYS, reach=0.15)
    return fit.select(fit.share >= ENOUGH)


def _outermost(
    circles: Fit, family: CircleFamily, radii: tuple[float, float], polarity: int
) -> np.ndarray:
    """Return the frames of the outermost circles that circles may belong to, (k, 3, 3)."""
    table = family.radii(np.array(family.numbers))
    found = []
    for colour in (1, -1):
        some = circles.frames[circles.polarity == colour * polarity]
        sizes = np.unique(table[:, 0 if colour > 0 else 1 :: 2].round(6))
        for of in sizes:
            found.append(frame.scaled(some, np.full(len(some), 1 / of)))
    frames = np.concatenate(found)
    major, _, _ = frame.ellipse_axes(frames)
    return frames[(major >= radii[0]) & (major <= radii[1])]


def _best_of_places(frames: np.ndarray, explained: np.ndarray) -> np.ndarray:
    """Return the indices of the frames that explain most of what lies about their centres."""
    size, centres = frame.mean_radii(frames), frames[:, :2, 2]
    kept: list[int] = []
    for index in np.argsort(-explained, kind='stable'):
        if explained[index] < _PROMISING:
            break
        away = np.hypot(*(centres[kept] - centres[index]).T)
        if not (away < 0.5 * np.maximum(size[kept], size[index])).any():
            kept.append(int(index))
    return np.array(kept, int)


def _aligned(
    gray: np.ndarray, frames: np.ndarray, read: Readings, family: CircleFamily, polarity: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frames that bring the rings of IDs onto the image, covariances of centres, shifts.

    Neighbouring circles are too close for their edges to be measured one by one. All that the
    rays show is compared with the rings at once (Gauss-Newton with robust weights).
    """
    angle, radius = (of.ravel() for of in np.meshgrid(_ANGLES, _PROFILE, indexing='ij'))
    basis = frame.displacement_basis(angle, radius).reshape(len(_ANGLES), len(_PROFILE), 7)
    shift = read.shift.copy()
    for _ in range(_ROUNDS):
        size = frame.mean_radii(frames)
        values = np.maximum(sample_circles(gray, frames, _ANGLES, _PROFILE), 0) * polarity
        light = np.abs(values).mean(axis=2, keepdims=True)
        values = values / np.maximum(light, 1)
        ink, slope, by_shift = _rings(family, read.ids, size, shift, read.blur)
        weight = np.broadcast_to(_PROFILE, values.shape)
        for _ in range(2):
            errors, step = _errors(values, ink, weight)
            spread = NORMAL * np.median(np.abs(errors), axis=(1, 2), keepdims=True)
            weight = _PROFILE / (1 + (errors / (_OUTLIER * spread)) ** 2) ** 2
        columns = -(step[..., None] * slope[:, None])[..., None] * basis
        of_shift = (step[..., None] * by_shift[:, None])[..., None]
        columns = np.concatenate([columns, of_shift], axis=3).reshape(len(frames), -1, 8)
        weighted = columns * weight.reshape(len(frames), -1, 1)
        normal = columns.transpose(0, 2, 1) @ weighted
        normal[:, 7, 7] += 1e-6 + normal[:, 7, 7] * 1e-3
        change = np.linalg.solve(
            normal, (weighted * errors.reshape(len(frames), -1, 1)).sum(axis=1)[..., None]
        )[..., 0]
        change = np.clip(change, -_MAXIMUM_CHANGE, _MAXIMUM_CHANGE)
        frames, shift = frame.moved(frames, change[:, :7]), shift + change[:, 7]
    variance = (weight * errors**2).sum(axis=(1, 2)) / weight.sum(axis=(1, 2))
    area = size**2 * (_PROFILE[1] - _PROFILE[0]) * (_ANGLES[1] - _ANGLES[0]) * 0.6
    variance *= np.maximum(1, _INDEPENDENT / area)
    inverse = np.linalg.inv(normal)
    covariance = inverse[:, :2, :2] * (variance * weight.mean(axis=(1, 2)))[:, None, None]
    affine = frame.local_affine(frames)
    covariance = affine @ covariance @ affine.transpose(0, 2, 1) + _SYSTEMATIC**2 * np.eye(2)
    return frames, covariance, shift


def _agreeing(
    gray: np.ndarray, frames: np.ndarray, read: Readings, family: CircleFamily, polarity: int
) -> np.ndarray:
    """Return the share of rays that show the rings of an ID by themselves, shape (k,)."""
    values = np.maximum(sample_circles(gray, frames, _ANGLES, _PROFILE), 0) * polarity
    ink = _rings(family, read.ids, frame.mean_radii(frames), read.shift, read.blur)[0]
    weight = np.broadcast_to(_PROFILE, values.shape)
    errors, step = _errors(values, ink, weight)
    mean = (weight * values).sum(axis=2, keepdims=True) / weight.sum(axis=2, keepdims=True)
    left = (weight * errors**2).sum(axis=2) / np.maximum(
        (weight * (values - mean) ** 2).sum(axis=2), 1e-9
    )
    return ((left < 1 - _AGREEING) & (step < 0)).mean(axis=1)


def _errors(values: np.ndarray, ink: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what is left of rays after paper and ink of their own, and the step of their ink."""
    ink = np.broadcast_to(ink[:, None], values.shape)
    total = weight.sum(axis=2)
    mean_ink, mean = ((weight * of).sum(axis=2) / total for of in (ink, values))
    away = ink - mean_ink[..., None]
    step = (weight * away * values).sum(axis=2) / (weight * away * away).sum(axis=2)
    return values - mean[..., None] - step[..., None] * away, step


def _rings(
    family: CircleFamily, ids: np.ndarray, size: np.ndarray, shift: np.ndarray, blur: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the ink of rings along the profile, and its derivatives by radius and shift."""
    radii = family.radii(ids)
    sign = np.where(np.arange(radii.shape[1]) % 2 == 0, 1, -1)
    size, shift, blur = (of[:, None] for of in (size, shift, blur))
    edges = (radii * (size - shift) + sign * shift) / size
    away = (edges[..., None] - _PROFILE) * (size / blur)[..., None]
    ink = (sign[:, None] * _normal_share(away)).sum(axis=1)
    density = np.exp(-0.5 * away**2) / np.sqrt(2 * np.pi) / blur[..., None]
    slope = -(sign[:, None] * density).sum(axis=1) * size
    by_shift = (sign[:, None] * density * (sign - radii)[..., None]).sum(axis=1)
    return ink, slope, by_shift
