"""Code words of rings of dots, by the evidence at all places and all phases of the ring."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.dots import DotFamily
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.dot_evidence import circle_steps, dot_evidence
from ahf_ros.features.frame import local_affine, project

_PHASES = 12  # of the ring, in the angle from one place to the next
_LIMIT = 8.0  # evidence that one place may give
_FAINTEST = 0.12  # step of ln of a disc
_BLUR = 0.9  # standard deviation of the blur, px, by which small dots are fainter than the disc
_BRIGHTEST = 1.1  # step of a dot, in that of the disc


@dataclass(frozen=True, slots=True)
class Readings(ArrayRecord):
    """What the rings of k targets were read as.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        As read, counter-clockwise in the image from any place.
    evidence : ndarray of float64, shape (k, n)
        At each place, for a dot or against it, limited.
    phase : ndarray of float64, shape (k,)
        Direction of the first place in the frame, rad clockwise from +x.
    inside : ndarray of bool, shape (k,)
        Whether the whole ring is in the image.
    """

    words: np.ndarray
    evidence: np.ndarray
    phase: np.ndarray
    inside: np.ndarray


def read_rings(
    log: np.ndarray, frames: np.ndarray, polarity: np.ndarray, code: DotFamily
) -> Readings:
    """Read rings of dots.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    frames : ndarray of float64, shape (k, 3, 3)
        Projective.
    polarity : ndarray of int, shape (k,)
    code : DotFamily
    """
    count, bits = len(frames), code.bits
    disc, _ = circle_steps(log, frames)
    usual = np.maximum(np.median(disc * polarity[:, None], axis=1), _FAINTEST)
    phases = 2 * np.pi / bits * np.arange(_PHASES) / _PHASES
    angles = -(phases[:, None] + 2 * np.pi * np.arange(bits) / bits)
    points = code.dot_circle * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    small = _small_frames(frames, points.reshape(-1, 2), code.dot_radius)
    steps, inside = circle_steps(log, small.reshape(-1, 3, 3))
    steps = steps.reshape(count, _PHASES, bits, steps.shape[1]) * polarity[:, None, None, None]
    steps /= usual[:, None, None, None]
    # Dots are fainter than the disc where they are small, all of them alike.
    size = np.sqrt(np.abs(np.linalg.det(small[:, 0, :2, :2])))
    faintest = 1 - np.exp(-0.5 * (size / _BLUR) ** 2)
    height = np.median(steps, axis=3).max(axis=(1, 2))
    height = np.clip(height, 0.6 * faintest, _BRIGHTEST)
    steps /= height[:, None, None, None]
    of_phases = small.reshape(count, _PHASES, bits, 3, 3)
    evidence = dot_evidence(steps, of_phases)
    # Between the places nothing is seen; the right phase is the one that sees most of the dots.
    best = np.maximum(evidence, 0).sum(axis=2).argmax(axis=1)
    evidence = np.clip(evidence[np.arange(count), best], -_LIMIT, _LIMIT)
    words = (evidence > 0) @ (1 << np.arange(bits, dtype=np.int64))
    whole = np.asarray(inside.reshape(count, _PHASES * bits).all(axis=1))
    return Readings(words, evidence, phases[best], whole)


def _small_frames(frames: np.ndarray, points: np.ndarray, radius: float) -> np.ndarray:
    """Return the frames of circles about points of targets, shape (k, m, 3, 3)."""
    moves = np.tile(np.eye(3), (len(points), 1, 1))
    moves[:, :2, :2] *= radius
    moves[:, :2, 2] = points
    small = frames[:, None] @ moves
    small = small / small[..., 2:, 2:]
    affine = np.zeros_like(small)
    affine[..., :2, :2] = local_affine(small.reshape(-1, 3, 3)).reshape(*small.shape[:2], 2, 2)
    affine[..., :2, 2] = project(frames, points)
    affine[..., 2, 2] = 1.0
    return affine
