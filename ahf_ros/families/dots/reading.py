"""Code words of rings of dots, by the evidence at all places and all phases of the ring."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.families.dots.discs import MINIMUM_STEP, border_steps
from ahf_ros.families.words import UNEXPECTED
from ahf_ros.prints.cyclic import mirrored_words, rotated_words
from ahf_ros.prints.dots import DotRingPrint
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.circle_fit import Fit
from ahf_ros.vision.dot_evidence import PIXELS_ASIDE, circle_sides, dot_evidence
from ahf_ros.vision.homography import local_frames

_PHASES = 12  # of the ring, in the angle from one place to the next
_RADII = np.array([0.5, 0.63, 0.8, 1.0, 1.2, 1.45])  # that small dots may have, in the printed one
_SPREAD = 0.5  # standard deviation of their ln
_FAINTEST = 0.6  # step of a dot, in the one that the blur leaves it
_LIMIT = 12.0  # evidence that one place may give


@dataclass(frozen=True, slots=True)
class Readings(ArrayRecord):
    """What the rings of k targets were read as.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        As read, counter-clockwise in the image from any place.
    evidence : ndarray of float64, shape (k, n)
        At each place, for a dot or against it, limited.
    between : ndarray of float64, shape (k,)
        The highest evidence for a dot halfway between places, where no target has any.
    phase : ndarray of float64, shape (k,)
        Direction of the first place in the frame, rad clockwise from +x.
    radius : ndarray of float64, shape (k,)
        Of the small dots, in radii of the disc.
    seen : ndarray of float64, shape (k,)
        Mean step of ln I at disc and border, in steps of the disc.
    height : ndarray of float64, shape (k,)
        Step of the dot that is seen best, in the one that the blur leaves it.
    inside : ndarray of bool, shape (k,)
        Whether the whole ring is in the image.
    """

    words: np.ndarray
    evidence: np.ndarray
    between: np.ndarray
    phase: np.ndarray
    radius: np.ndarray
    seen: np.ndarray
    height: np.ndarray
    inside: np.ndarray


def read_rings(log: np.ndarray, fit: Fit, code: DotRingPrint) -> Readings:
    """Read the rings of fitted discs and borders; `log` is LOG_SCALE ln(I + 8), int16."""
    count, bits, polarity = len(fit.frames), code.bits, fit.polarity
    disc = np.diff(circle_sides(log, fit.frames)[0])[..., 0]
    usual = np.maximum(np.median(disc * polarity[:, None], axis=1), MINIMUM_STEP)
    phases = 2 * np.pi / bits * np.arange(_PHASES) / _PHASES
    points = dot_points((phases[:, None] - 2 * np.pi * np.arange(bits) / bits).ravel(), code)
    aside = np.repeat(np.maximum(PIXELS_ASIDE, fit.blur), _PHASES * bits)
    room = min(code.dot_circle - 1, code.ground_radius - code.dot_circle)
    widest = min(room, code.dot_circle * np.sin(np.pi / bits))
    radii = np.minimum(code.dot_radius * _RADII, widest)
    shape = (len(radii), count, _PHASES, bits)
    small = np.stack([local_frames(fit.frames, points, np.full(len(points), r)) for r in radii])
    single = small.reshape(len(radii), -1, 3, 3)
    of_radii = [circle_sides(log, frames, aside) for frames in single]
    inside = np.asarray(of_radii[-1][1].reshape(count, _PHASES * bits).all(axis=1))
    steps = np.diff([of_one for of_one, _ in of_radii])[..., 0]
    steps = steps.reshape(*shape, steps.shape[-1]) * polarity[:, None, None, None]
    steps /= usual[:, None, None, None]
    small = small.reshape(*shape, 3, 3)
    # The right radius is the one that sees most of the dots, at the right phase.
    middle = np.median(steps, axis=4)
    seen = np.maximum(middle, 0).sum(axis=3).max(axis=2).T
    usual = np.exp(-0.5 * (np.log(radii / code.dot_radius) / _SPREAD) ** 2)
    own, every = (seen * usual).argmax(axis=1), np.arange(count)
    # Dots are fainter than the disc where they are small, all of them alike.
    steps, small, middle = steps[own, every], small[own, every], middle[own, every]
    size = np.sqrt(np.abs(np.linalg.det(small[:, 0, 0, :2, :2])))
    faintest = 1 - np.exp(-0.5 * (size / fit.blur) ** 2)
    highest = middle.max(axis=(1, 2))
    steps /= np.maximum(highest, _FAINTEST * faintest)[:, None, None, None]
    evidence = dot_evidence(steps, small)
    # Between the places nothing is seen; the right phase is the one that sees most of the dots.
    best = np.maximum(evidence, 0).sum(axis=2).argmax(axis=1)
    halfway = (best + _PHASES // 2) % _PHASES
    between = np.clip(evidence[every, halfway].max(axis=1), -_LIMIT, _LIMIT)
    evidence = np.clip(evidence[every, best], -_LIMIT, _LIMIT)
    return Readings(
        words=(evidence > 0) @ (1 << np.arange(bits, dtype=np.int64)),
        evidence=evidence,
        between=between,
        phase=phases[best],
        radius=radii[own],
        seen=border_steps(log, fit.frames, polarity, code, np.ones(1))[:, 0],
        height=highest / faintest,
        inside=inside,
    )


def expecting(readings: Readings, code: DotRingPrint, expected: frozenset[int]) -> Readings:
    """Return readings once some IDs are likely to be there.

    One of these takes the place of a word that is not much likelier. Others must be wrong at two
    places to be one of them, so that any place of an expected word is surer.
    """
    own = code.words[np.isin(code.numbers, sorted(expected))]
    own = np.concatenate([own, mirrored_words(own, code.bits)])
    words = np.unique([rotated_words(own, turn, code.bits) for turn in range(code.bits)])
    if not words.size:
        return readings
    marked = (words[:, None] >> np.arange(code.bits) & 1) > 0
    lost = np.where(marked, -np.minimum(readings.evidence[:, None], 0), 0.0).sum(axis=2)
    lost += np.where(marked, 0.0, np.maximum(readings.evidence[:, None], 0)).sum(axis=2)
    best = lost.argmin(axis=1)
    likely = lost[np.arange(len(best)), best] <= UNEXPECTED
    signs = np.where(marked[best], 1, -1)
    evidence = signs * np.maximum(signs * readings.evidence + UNEXPECTED, 0.0)
    return replace(
        readings,
        words=np.where(likely, words[best], readings.words),
        evidence=np.where(likely[:, None], evidence, readings.evidence),
    )


def dot_points(angles: np.ndarray, code: DotRingPrint) -> np.ndarray:
    """Return the centres of small dots in directions, rad clockwise from +x, shape (..., 2)."""
    return code.dot_circle * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
