"""Projected light patterns, in projector pixels."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

Pattern = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From projector pixels (u, v), float32 of one shape, to the brightness there, 0 to 1."""

HALF_VIEW = (640.0, 400.0)
"""Half the size of a 1280 x 800 projector, px."""

PROJECTOR_PIXELS = 6.4
"""Per radius of a dot: 1280 across an image of 200 radii, as scenes are by default."""


def uniform(_generator: np.random.Generator, _defocus: float, _shift: float) -> Pattern:
    """Return full light everywhere."""
    return lambda u, _v: np.ones_like(u)


def stripes(
    generator: np.random.Generator,
    defocus: float,
    shift: float,
    *,
    period: float,
    direction: float = 0.0,
) -> Pattern:
    """Return hard-edged stripes with half of each period, in projector px, lit.

    Each pattern deviates from the direction of their normal, rad from +u, by up to 10 degrees, and
    half of the patterns are mirrored.
    """
    x, y, phase = _wave(generator, period, direction, shift)

    def pattern(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        along = _remainder(u * x + (v * y + phase), period)
        return _soft_step(np.float32(period / 4) - np.abs(along, out=along), defocus)

    return pattern


def fringe(
    generator: np.random.Generator, defocus: float, shift: float, *, period: float
) -> Pattern:
    """Return sinusoidal fringes with a period in projector px."""
    x, y, phase = _wave(generator, period, 0.0, shift)
    wave = np.float32(2 * math.pi / period)
    contrast = np.float32(0.5 * math.exp(-((float(wave) * defocus) ** 2) / 2))

    def pattern(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.float32(0.5) + contrast * np.cos((u * x + (v * y + phase)) * wave)

    return pattern


def lattice(
    generator: np.random.Generator, defocus: float, shift: float, *, period: float, diameter: float
) -> Pattern:
    """Return a square lattice of bright round spots; lengths in projector px.

    A shift moves them twice as far along the second axis, so that four of a quarter light almost
    every point.
    """
    x, y, phase = _wave(generator, period, 0.0, shift)
    second = np.float32(generator.uniform(0, period) + 2 * shift * period)

    def pattern(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        across = _remainder(u * x + (v * y + phase), period)
        along = _remainder(v * x - (u * y + second), period)
        distance = np.sqrt(across * across + along * along)
        return _soft_step(np.float32(diameter / 2) - distance, defocus)

    return pattern


def spots(generator: np.random.Generator, defocus: float, _shift: float) -> Pattern:
    """Return three large bright spots with soft edges in the dark."""
    half_width, half_height = HALF_VIEW
    u_centres = (np.array([-0.6, 0.0, 0.6]) + generator.uniform(-0.12, 0.12, 3)) * half_width
    v_centres = generator.uniform(-0.5, 0.5, 3) * half_height
    radii = generator.uniform(170, 240, 3)
    softness = math.hypot(35, defocus)

    def pattern(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        brightest = np.zeros_like(u)
        spots = np.stack((u_centres, v_centres, radii), 1).astype(np.float32)
        for u_centre, v_centre, radius in spots:
            distance = np.sqrt((u - u_centre) ** 2 + (v - v_centre) ** 2)
            np.maximum(brightest, _soft_step(radius - distance, softness), out=brightest)
        return brightest

    return pattern


def shadow(generator: np.random.Generator, defocus: float, _shift: float) -> Pattern:
    """Return full light with hard shadows of bars and convex polygons."""
    edges = [_bar(generator) for _ in range(3)] + [_polygon(generator) for _ in range(9)]

    def pattern(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        outside = np.full_like(u, np.inf)
        for occluder in edges:
            distance = np.full_like(u, -np.inf)
            for x, y, offset in occluder:
                np.maximum(distance, u * x + (v * y - offset), out=distance)
            np.minimum(outside, distance, out=outside)
        return _soft_step(outside, defocus)

    return pattern


_MAKERS: dict[str, Callable[[np.random.Generator, float, float], Pattern]] = {
    'normal': uniform,
    'stripe': partial(stripes, period=26),
    'wide_stripe': partial(stripes, period=70),
    'fine_stripe': partial(stripes, period=14),
    'diagonal_stripe': partial(stripes, period=34, direction=math.pi / 4),
    'lattice': partial(lattice, period=30, diameter=18),
    'dense_lattice': partial(lattice, period=16, diameter=9.6),
    'fringe': partial(fringe, period=40),
    'spots': spots,
    'shadow': shadow,
}
LIGHT_NAMES: tuple[str, ...] = tuple(_MAKERS)
"""Names of the lights."""


def light_pattern(
    name: str, defocus: float, generator: np.random.Generator, shift: float = 0.0
) -> Pattern:
    """Return the pattern of one of `LIGHT_NAMES` with random phase, directions and positions.

    The defocus of the projector is a standard deviation in projector px. The shift is added to the
    phase, in periods; a light without a period stays as it is.
    """
    return _MAKERS[name](generator, defocus, shift)


def turned(pattern: Pattern, scale: float, turn: float) -> Pattern:
    """Return a pattern, scaled and turned about the middle of the projector.

    The turn is from +u towards +v, rad. Edges get softer with the scale, too.
    """
    if scale == 1 and not turn:
        return pattern
    along, across = np.float32(math.cos(turn) / scale), np.float32(math.sin(turn) / scale)
    return lambda u, v: pattern(u * along + v * across, v * along - u * across)


def _wave(
    generator: np.random.Generator, period: float, direction: float, shift: float
) -> tuple[np.float32, np.float32, np.float32]:
    """Return a unit normal (x, y) near a direction or its mirror image, and a shifted phase."""
    angle = direction + generator.uniform(-math.radians(10), math.radians(10))
    angle *= generator.choice((-1, 1))
    phase = generator.uniform(0, period) + shift * period
    return np.float32(math.cos(angle)), np.float32(math.sin(angle)), np.float32(phase)


def _remainder(values: np.ndarray, period: float) -> np.ndarray:
    """Subtract the nearest multiple of the period from `values`, in place, and return them."""
    turns = values * np.float32(1 / period)
    values -= np.rint(turns, out=turns) * np.float32(period)
    return values


def _soft_step(distance: np.ndarray, sigma: float) -> np.ndarray:
    """Return an edge blurred by a Gaussian, 1 where `distance` is large.

    The error function is approximated to 3e-4 by tanh, which numpy has in float32.
    """
    if not sigma:
        return (distance > 0).astype(np.float32)
    scaled = distance * np.float32(1 / sigma)
    np.clip(scaled, -6, 6, out=scaled)
    cubic = scaled * scaled
    cubic *= np.float32(0.0356774)
    cubic += np.float32(0.7978846)
    scaled *= cubic
    np.tanh(scaled, out=scaled)
    scaled *= np.float32(0.5)
    scaled += np.float32(0.5)
    return scaled


def _bar(generator: np.random.Generator) -> list[tuple[np.float32, np.float32, np.float32]]:
    """Return the two sides of a bar across the view, as outward normals and offsets."""
    angle = generator.uniform(0, math.pi)
    x, y = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    middle = np.float32(generator.uniform(-350, 350))
    half = np.float32(generator.uniform(6, 22))
    return [(x, y, middle + half), (-x, -y, half - middle)]


def _polygon(generator: np.random.Generator) -> list[tuple[np.float32, np.float32, np.float32]]:
    """Return the sides of a convex polygon around a random point of the view."""
    place = generator.uniform(-1, 1, 2) * HALF_VIEW
    corners = int(generator.integers(3, 7))
    turn = generator.uniform(0, 2 * math.pi)
    steps = (np.arange(corners) + generator.uniform(-0.2, 0.2, corners)) / corners
    size = generator.uniform(20, 90)
    sides = []
    for angle in turn + 2 * math.pi * steps:
        x, y = math.cos(angle), math.sin(angle)
        offset = place[0] * x + place[1] * y + size * generator.uniform(0.5, 1.0)
        sides.append((np.float32(x), np.float32(y), np.float32(offset)))
    return sides
