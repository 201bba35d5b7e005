"""Distractors, marks that are not coded targets: plain dots, rings, text, leaves."""

from __future__ import annotations

import math
import string

import cv2
import numpy as np

from ahf_ros.synthetic.camera import Camera
from ahf_ros.synthetic.covers import Cover, stamp_cover
from ahf_ros.synthetic.layout import Placements, scattered_placements
from ahf_ros.synthetic.prints import Mark, mark_at

_SIDE = 256  # px of a stamp, finer than any distractor in an image
_FINE = 3  # fractional bits of drawing coordinates


def distractor_cover(generator: np.random.Generator) -> tuple[Cover, float]:
    """Return the ink of a random distractor in the unit circle, and its radius in dot radii.

    Parameters
    ----------
    generator : numpy.random.Generator
        Draws its kind, shape, size, direction and darkness.
    """
    kinds = ((_dot, 1.0), (_ring, 2.0), (_text, 3.0), (_leaf, 4.0))
    draw, radius = kinds[generator.integers(len(kinds))]
    stamp = np.zeros((_SIDE, _SIDE), np.uint8)
    draw(stamp, generator)
    turned = generator.uniform(0, 2 * math.pi)
    return stamp_cover(stamp, 1.0, turned), radius * generator.uniform(0.6, 1.3)


def _fixed(points: np.ndarray) -> np.ndarray:
    """Return points of the unit circle as fixed-point drawing coordinates."""
    pixels = (np.asarray(points) + 1) * (_SIDE / 2) - 0.5
    return np.rint(pixels * 2**_FINE).astype(np.int32)


def _dot(stamp: np.ndarray, _generator: np.random.Generator) -> None:
    """Draw an uncoded target."""
    middle = tuple(_fixed(np.zeros(2)).tolist())
    radius = int(0.95 * _SIDE / 2 * 2**_FINE)
    cv2.circle(stamp, middle, radius, 255, -1, cv2.LINE_AA, _FINE)


def _ring(stamp: np.ndarray, generator: np.random.Generator) -> None:
    """Draw a closed ring, like a letter O or a washer."""
    middle = tuple(_fixed(np.zeros(2)).tolist())
    outer = 0.95 * _SIDE / 2 * 2**_FINE
    inner = outer * generator.uniform(0.4, 0.8)
    cv2.circle(stamp, middle, int(outer), 255, -1, cv2.LINE_AA, _FINE)
    cv2.circle(stamp, middle, int(inner), 0, -1, cv2.LINE_AA, _FINE)


def _text(stamp: np.ndarray, generator: np.random.Generator) -> None:
    """Draw one to three lines of capital letters and digits."""
    characters = np.array(list(string.ascii_uppercase + string.digits))
    count = int(generator.integers(1, 4))
    height = 1.3 / count
    for line in range(count):
        text = ''.join(generator.choice(characters, int(generator.integers(2, 6))))
        font, weight = cv2.FONT_HERSHEY_DUPLEX, int(generator.integers(2, 6))
        (width, ascent), _ = cv2.getTextSize(text, font, 1.0, weight)
        scale = min(1.2 * _SIDE / 2 / width, 0.7 * height * _SIDE / 2 / ascent)
        baseline = (-0.65 + height * (line + 0.8) + 1) * _SIDE / 2
        origin = (int(0.2 * _SIDE), int(baseline))
        cv2.putText(stamp, text, origin, font, scale, 255, weight, cv2.LINE_AA)


def _leaf(stamp: np.ndarray, generator: np.random.Generator) -> None:
    """Draw a pointed leaf with a stalk, lighter than ink and with a light vein."""
    along = np.linspace(0, 1, 40)
    breadth = generator.uniform(0.2, 0.45)
    edge = breadth * np.sin(math.pi * along ** generator.uniform(0.6, 1.0))
    bend = generator.uniform(-0.3, 0.3) * np.sin(math.pi * along)
    spine = np.stack((1.3 * along - 0.4, bend), axis=1)
    side = np.stack((np.zeros_like(edge), edge), axis=1)
    outline = np.concatenate((spine + side, (spine - side)[::-1]))
    shade = int(generator.integers(120, 240))
    cv2.fillPoly(stamp, [_fixed(outline)], shade, cv2.LINE_AA, _FINE)
    stalk = np.array([[-0.9, generator.uniform(-0.2, 0.2)], [-0.4, 0.0]])
    cv2.polylines(stamp, [_fixed(stalk)], False, shade, 6, cv2.LINE_AA, _FINE)
    cv2.polylines(stamp, [_fixed(spine)], False, shade // 2, 3, cv2.LINE_AA, _FINE)


def distractor_marks(
    count: int, unit: float, camera: Camera, taken: Placements, generator: np.random.Generator
) -> list[Mark]:
    """Return distractors that overlap neither each other nor what is placed already.

    Parameters
    ----------
    count : int
        Number of distractors.
    unit : float
        Unit of their radii, px in the image.
    camera : Camera
    taken : Placements
        Of the targets.
    generator : numpy.random.Generator
    """
    drawn = [distractor_cover(generator) for _ in range(count)]
    radii = np.array([radius for _, radius in drawn]) * unit
    placements = scattered_placements(camera, radii, taken, generator)
    return [
        mark_at(camera, pixel, radius, 1.0, cover)
        for pixel, radius, (cover, _) in zip(placements.centres, radii, drawn, strict=True)
    ]
