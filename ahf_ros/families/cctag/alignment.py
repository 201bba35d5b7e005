"""The rings of IDs are brought onto an image: place, shape, perspective and edges at once.

Neighbouring circles are too close for their edges to be measured one by one. So all gray values
about a centre are fitted, without the light, which is found first. The values of each ray are a
linear function of the ink of sharp rings under a normal blur.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.families.cctag.light import Lights, lit
from ahf_ros.families.cctag.prior import USUAL, Prior
from ahf_ros.families.cctag.rays import ALONG, PROFILE, RAYS, Rays, Seen
from ahf_ros.families.cctag.rings import NOTHING, Aligned
from ahf_ros.families.cctag.templates import MASK, MAXIMUM_SHIFT, rings_along, signed_circles
from ahf_ros.prints.cctag import CctagPrint
from ahf_ros.vision import frame
from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.robust import medians, quantiles

_PART = 48  # targets at a time, which bounds the memory
_OUTLIERS = 12.0, 6.0, 3.0, 3.0  # deviations that quarter a weight, in rounds of Gauss-Newton
_IN_PLACE = 2  # rounds less, where rings are nearly in place
_MAXIMUM_CHANGE = 0.08  # of a frame in a round, radii
_PERSPECTIVE = 5e-4  # change of scale along a px where tilted by 45 degrees: 1 / focal length, px
_LEAST_TILT = 0.1  # tangent of the tilt that a circular target may have
_LEAST_VARIANCE = 1e-6  # of gray values, of their mean
_OF_VARIANCE = 2.0  # of gray values, that their model adds
_SHARPEST, _SOFTEST = 0.35, 1.5  # blur: px, and in narrow rings, which more of it would hide
_SHARPENINGS = 0.0, 4.0  # amounts of it
_HELD = 1e9  # weight of a bound
_MOST_OF_EDGES = 0.3, 0.3, 1.0  # change of shift, ln of the blur and sharpening in a round
_CLEAREST = 0.2  # share of rays
_AGREEING = 0.5  # share of what a ray shows, that the rings explain
_USUAL_EDGES = 0.13, 0.3  # deviations of growth, px, and of ln of the blur, of targets
_OUT_OF_FOCUS = 0.5  # blur that is not unusual, widths of narrow rings
_GROWTH_HIDES = 3.0  # ln of odds, at the most growth
_CLIPPING_HIDES = 3.0  # ln of odds, where all gray values are clipped


def align(
    gray: np.ndarray,
    frames: np.ndarray,
    ids: np.ndarray,
    edges: np.ndarray,
    family: CctagPrint,
    prior: Prior = USUAL,
    lights: Lights | None = None,
    rays: int = RAYS,
    in_place: bool = False,
) -> Aligned:
    """Bring the rings of IDs (k,) onto an image from frames (k, 3, 3), known to about a tenth.

    The edges to begin with, (k, 3), are growth of ink and blur, px, and sharpening. The lights are
    those about the frames, unless they are given. Rings that are nearly in place take half of the
    rounds.
    """
    if lights is None:
        lights = Lights.about(gray, frames)
    parts = [slice(start, start + _PART) for start in range(0, len(frames), _PART)]
    outliers = _OUTLIERS[_IN_PLACE:] if in_place else _OUTLIERS
    return Aligned.joined(
        [NOTHING]
        + [
            _aligned(
                *(gray, frames[part], ids[part], edges[part], family, prior),
                *(lights.select(part), rays, outliers),
            )
            for part in parts
        ]
    )


def _aligned(
    gray: np.ndarray,
    frames: np.ndarray,
    ids: np.ndarray,
    edges: np.ndarray,
    family: CctagPrint,
    prior: Prior,
    lights: Lights,
    count: int,
    outliers: Sequence[float],
) -> Aligned:
    """Return what `align` does, by Gauss-Newton with robust weights."""
    circles, usual = signed_circles(family, ids), usual_perspective(frames)
    for outlier in outliers:
        size = frame.mean_radii(frames)
        seen = lit(gray, frames, lights, count)
        rays = Rays.of(seen, rings_along(circles, size, *edges.T), outlier)
        change, normal = _changed(rays, frames, size, edges, prior, usual)
        frames = frame.moved(frames, change[:, :7])
        narrow, (shift, blur, sharpening) = family.narrow * size, edges.T
        most, softest = MAXIMUM_SHIFT * narrow, np.maximum(_SOFTEST * narrow, _SHARPEST)
        shift = (shift + change[:, 7]).clip(-most, most)
        blur = (blur * np.exp(change[:, 8])).clip(_SHARPEST, softest)
        sharpening = (sharpening + change[:, 9]).clip(*_SHARPENINGS)
        edges = np.stack([shift, blur, sharpening], axis=1)
    covariance = frame.centre_covariance(frames, np.linalg.inv(normal)[:, :2, :2])
    seen = lit(gray, frames, lights, count)
    rays = Rays.of(seen, rings_along(circles, frame.mean_radii(frames), *edges.T))
    return _described(seen, rays, frames, ids, edges, covariance, family.narrow, prior)


def _changed(
    rays: Rays,
    frames: np.ndarray,
    size: np.ndarray,
    edges: np.ndarray,
    prior: Prior,
    usual: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the changes of frames and edges, (k, 10), that rays ask for, and normal matrices.

    The inverse covariances of the usual perspective have the shape (k, 2, 2).
    """
    area = size**2 * (PROFILE[1] - PROFILE[0]) * 2 * np.pi
    # Pixels are independent.
    each = np.minimum(area / rays.step.shape[1], 1.0) / _OF_VARIANCE
    each /= rays.variance + _LEAST_VARIANCE
    normal, right = rays.normal * each[:, None, None], rays.right * each[:, None]
    normal[:, range(5), range(5)] += 1e-6
    normal[:, 5:7, 5:7] += usual
    right[:, 5:7] -= (usual @ frames[:, 2, :2, None])[..., 0]
    known = np.array(prior.deviations) ** -2
    normal[:, range(7, 10), range(7, 10)] += known
    right[:, 7:] -= prior.away(*edges.T) * known
    change = np.linalg.solve(normal, right[..., None])[..., 0]
    # What goes beyond a bound is held there, so that the others do not make up for it.
    sharpening = edges[:, 2]
    bounded = np.clip(sharpening + change[:, 9], *_SHARPENINGS) - sharpening
    held = np.where(bounded == change[:, 9], 0.0, _HELD)
    normal[:, 9, 9] += held
    right[:, 9] += held * bounded
    change = np.linalg.solve(normal, right[..., None])[..., 0]
    limit = np.concatenate([np.full(7, _MAXIMUM_CHANGE), _MOST_OF_EDGES])
    return np.clip(change, -limit, limit), normal


def _described(
    seen: Seen,
    rays: Rays,
    frames: np.ndarray,
    ids: np.ndarray,
    edges: np.ndarray,
    covariance: np.ndarray,
    narrow: float,
    prior: Prior,
) -> Aligned:
    """Return rings in their places, and how well they explain what rays show."""
    size, (shift, blur, sharpening) = frame.mean_radii(frames), edges.T
    left, shown, mean = (
        (of @ ALONG).astype(np.float64) for of in (rays.errors**2, seen.values**2, seen.values)
    )
    shown -= mean**2 / ALONG.sum()
    sign = np.sign(medians(rays.step))
    agreeing = (left < (1 - _AGREEING) * shown) & (np.sign(rays.step) == sign[:, None])
    agree = agreeing.mean(axis=1)
    rest = np.log(np.maximum(left, 1e-6) / np.maximum(shown, 1e-6))
    good = np.where(agreeing, np.exp(-rest), 1e-3)
    known = (rays.gain * ALONG).sum(axis=2).mean(axis=1) / ALONG.sum()
    return Aligned(
        frames=frames,
        ids=ids,
        covariance=covariance,
        shift=shift,
        blur=blur,
        sharpening=sharpening,
        colour=-sign,
        rays=agree,
        clear=quantiles(rest, _CLEAREST),
        left=rest.mean(axis=1),
        plain=_plain(
            rays.model + rays.errors / np.maximum(rays.gain, 0.05),
            rays.model,
            good[..., None] * rays.weight * rays.gain**2,
            blur / size,
        ),
        unusual=_unusual(shift, blur, narrow * size, prior) * np.minimum(3 * (1 - agree), 1)
        + _hiding(shift, known, narrow * size),
        known=known,
        margin=np.full(len(frames), np.nan),
        by_pixels=np.zeros(len(frames)),
    )


def _unusual(shift: np.ndarray, blur: np.ndarray, narrow: np.ndarray, prior: Prior) -> np.ndarray:
    """Return half the squares of deviations of edges, (k,): chance finds rings of any growth.

    Rings that are out of focus are as usual as those of a smaller image.
    """
    times = np.clip(_OUT_OF_FOCUS * narrow / prior.blur, 1, np.maximum(blur / prior.blur, 1))
    deviations = np.stack(
        [shift / times - prior.shift, np.log(blur / (times * prior.blur))], axis=1
    )
    deviations /= _USUAL_EDGES
    return (deviations**2).sum(axis=1) / 2


def _hiding(shift: np.ndarray, known: np.ndarray, narrow: np.ndarray) -> np.ndarray:
    """Return by how much growth and clipping hide narrow rings of so many px, (k,)."""
    grown = _GROWTH_HIDES * (shift / (MAXIMUM_SHIFT * narrow)) ** 8
    return grown + _CLIPPING_HIDES * (1 - known) * (MASK / narrow) ** 2


def usual_perspective(frames: np.ndarray) -> np.ndarray:
    """Return the inverse covariances of the perspective of frames, (k, 2, 2), that is expected.

    Scale changes along the minor axis of a tilted target, the more the more it is foreshortened.
    """
    _, axes, directions = np.linalg.svd(frame.local_affine(frames))
    tilt = np.sqrt(np.maximum((axes[:, 0] / axes[:, 1]) ** 2 - 1, 0))
    most = np.stack([np.full(len(frames), _LEAST_TILT), tilt + _LEAST_TILT], axis=1)
    weight = (most * _PERSPECTIVE * frame.mean_radii(frames)[:, None]) ** -2
    return directions.transpose(0, 2, 1) * weight[:, None] @ directions


def _plain(seen: np.ndarray, rings: np.ndarray, good: np.ndarray, blur: np.ndarray) -> np.ndarray:
    """Return by how much better rings explain a profile than two edges of any height do, (k,).

    It is the difference of ln of what is left of the weighted mean of rays. What is seen, what
    the rings make of it and the weights `good` have the shape (k, rays, n). The blur is in radii.
    """
    shown = good.sum(axis=1)
    profiles, inks = ((good * of).sum(axis=1) / np.maximum(shown, 1e-9) for of in (seen, rings))
    weights = np.sqrt(shown / shown.sum(axis=1, keepdims=True))
    edges = np.linspace(PROFILE[0], PROFILE[-1], 66)[3:-3, None]
    line, _ = np.linalg.qr(np.stack([weights, PROFILE * weights], axis=2))
    steps = normal_integral((edges - PROFILE) / blur[:, None, None])
    values = np.concatenate([profiles[:, None], inks[:, None], steps], axis=1) * weights[:, None]
    values -= (values @ line) @ line.transpose(0, 2, 1)
    profile, ink, steps = values[:, 0], values[:, 1], values[:, 2:]
    total = np.maximum((profile**2).sum(axis=1), 1e-12)
    steps = steps / np.maximum(np.linalg.norm(steps, axis=2, keepdims=True), 1e-9)
    along, alike = (steps @ profile[..., None])[..., 0], steps @ steps.transpose(0, 2, 1)
    both = along[:, :, None] ** 2 + along[:, None] ** 2
    both -= 2 * alike * along[:, :, None] * along[:, None]
    of_two = (both / np.maximum(1 - alike**2, 1e-3)).max(axis=(1, 2)) / total
    of_ink = (ink * profile).sum(axis=1) ** 2 / np.maximum((ink**2).sum(axis=1), 1e-12) / total
    return np.log(np.maximum(1 - of_two, 1e-6) / np.maximum(1 - of_ink, 1e-6))
