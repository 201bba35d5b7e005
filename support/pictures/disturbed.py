"""Scenes of targets that are disturbed in all the ways that a table has rows for."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from ahf_ros.base.target import TrueTarget
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.cyclic import smallest_rotation
from ahf_ros.prints.ring import RingPrint, family
from support.pictures import occluders
from support.pictures.exposure import Exposure
from support.pictures.sheets import COLUMNS, Sheet, random_numbers, target_sheet

RADIUS = 12.0
"""Of the dots, px."""

_CELL = 10.0  # half of the side of a cell with a target on another one, dot radii

COVERS = {'black': 61.0, 'gray 80': 80.0, 'gray 128': 128.0, 'gray 170': 170.0, 'white': 220.0}
"""Gray values of what covers targets; black and white are those of ink and paper."""

Scene = tuple[np.ndarray, Sequence[TrueTarget]]
"""An image and the targets that it shows."""


def exposures() -> dict[str, Exposure]:
    """Return the disturbances of whole sheets by their names."""
    rows = {'clean': Exposure()}
    for sectors in (1, 2, 3):
        for name, gray in COVERS.items():
            wedge = occluders.over_sectors(sectors, gray)
            rows[f'{name} over {sectors} sector' + 's' * (sectors > 1)] = Exposure(occluder=wedge)
    for name, gray in COVERS.items():
        wedge = occluders.over_sectors(2, gray, whole=True)
        rows[f'{name} over 2 whole sectors'] = Exposure(occluder=wedge)
    for name in ('black', 'gray 128', 'white'):
        for distance in (2.0, 1.4):
            edge = occluders.paper(distance, COVERS[name])
            rows[f'{name} paper {distance} dot radii away'] = Exposure(occluder=edge)
    for name in ('black', 'gray 128', 'white'):
        bar = occluders.finger(2.0, COVERS[name])
        rows[f'{name} finger 2 dot radii wide'] = Exposure(occluder=bar)
    spot = occluders.disc(1.0, COVERS['white'])
    rows['white spot of 1 dot radius'] = Exposure(occluder=spot)
    dirt = 1 / RADIUS, 3 / RADIUS
    for count in (15, 40):
        grains = occluders.specks(count, dirt)
        rows[f'{count} specks of 1 to 3 px'] = Exposure(occluder=grains)
    for count in (3, 6):
        lines = occluders.scratches(count, dirt)
        rows[f'{count} scratches 1 to 3 px wide'] = Exposure(occluder=lines)
    for radius, added in ((1.0, 200.0), (1.0, 400.0), (1.5, 200.0)):
        glare = occluders.highlight(radius, added)
        rows[f'highlight of {radius} dot radii, +{added:.0f}'] = Exposure(glare=glare)
    for contrast, noise in ((20, 1.5), (15, 1.0), (10, 0.7), (5, 0.5)):
        levels = (130.0, 130.0 - contrast, noise)
        rows[f'{contrast} gray levels, noise {noise}'] = Exposure(levels=levels)
    for white, dark in ((180, 120), (160, 120), (90, 60), (240, 200), (100, 60)):
        rows[f'{dark} on {white}'] = Exposure(levels=(white, dark, 1.0))
    rows['gamma 0.3'] = Exposure(develop=partial(power, 0.3))
    for light in (3.0, 4.0, 0.01):
        rows[f'exposed {light:g} times'] = Exposure(light=light)
    for blur in (2.0, 3.0):
        rows[f'blur of {blur:g} px'] = Exposure(develop=partial(blurred, blur))
    for noise in (10.0, 30.0):
        rows[f'noise of {noise:g}'] = Exposure(develop=partial(noisy, noise))
    for quality in (30, 5):
        rows[f'JPEG {quality}'] = Exposure(develop=partial(compressed, quality))
    return rows


def power(exponent: float, image: np.ndarray, _: np.random.Generator) -> np.ndarray:
    """Return an image with another gamma."""
    return np.rint(255 * (image / 255) ** exponent).astype(np.uint8)


def blurred(blur: float, image: np.ndarray, _: np.random.Generator) -> np.ndarray:
    """Return an image blurred with a standard deviation in px."""
    return cv2.GaussianBlur(image, (0, 0), blur)


def noisy(noise: float, image: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return an image with noise of a standard deviation in gray values."""
    values = image + noise * generator.standard_normal(image.shape)
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def compressed(quality: int, image: np.ndarray, _: np.random.Generator) -> np.ndarray:
    """Return an image after JPEG compression."""
    code = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_GRAYSCALE))


def overlapping(
    name: str, numbers: np.ndarray, seed: int, distance: float, radius: float = 12.0
) -> tuple[np.ndarray, list[TrueTarget]]:
    """Return an image of targets with another one on each, and all targets that it shows.

    Parameters
    ----------
    name : str
        Family of all targets.
    numbers : ndarray of int
        IDs of the targets below; those above have other ones.
    seed : int
    distance : float
        Between the centres of two targets, dot radii.
    radius : float
        Of the dots, px.
    """
    sheet = target_sheet(name, numbers, seed, radius=radius, cell=_CELL)
    generator = np.random.default_rng([seed, 3])
    free = np.setdiff1d(family(name).numbers, numbers)
    above = generator.permutation(free)[: len(numbers)].tolist()
    directions = generator.uniform(0, 2 * math.pi, len(numbers)).tolist()
    papers = occluders.other_targets(name, above, distance, directions)
    truth = sheet.truth
    for mark, number, direction in zip(sheet.marks, above, directions, strict=True):
        x, y = mark.plane @ (distance * np.array([math.cos(direction), math.sin(direction)]))
        truth.append(TrueTarget(number, mark.x + x, mark.y + y))
    return sheet.photograph(Exposure(occluder=papers)), truth


def far_apart(code: RingPrint, sectors: int, seed: int) -> tuple[int, ...]:
    """Return IDs that cannot look alike, up to a number of sectors of each covered.

    Parameters
    ----------
    code : Family
    sectors : int
        Largest number of neighbouring sectors that are covered.
    seed : int
        Of the order in which IDs are tried.
    """
    windows = [
        sum(1 << (start + step) % code.bits for step in range(count))
        for count in range(sectors + 1)
        for start in range(code.bits)
    ]
    seen: set[int] = set()
    chosen = []
    for index in np.random.default_rng([seed, 8]).permutation(len(code.words)).tolist():
        left = code.words[index] & ~np.array(windows)
        looks = set(smallest_rotation(left, code.bits).tolist())
        if not looks & seen:
            chosen.append(int(code.numbers[index]))
            seen |= looks
    return tuple(sorted(chosen))


@dataclass(frozen=True, slots=True)
class Targets:
    """The targets of one family that a table is made of.

    Attributes
    ----------
    name : str
        Their family.
    count : int
        Number of targets of a row.
    seed : int
        Of the first sheet.
    bright : bool
        Whether they are bright on dark.
    among : tuple of int
        Their IDs; any of the family where it is empty.
    """

    name: str
    count: int
    seed: int
    bright: bool = False
    among: tuple[int, ...] = ()

    def sheets(self) -> list[Sheet]:
        """Return whole sheets."""
        return [
            target_sheet(self.name, numbers, self.seed + index, bright=self.bright)
            for index, numbers in enumerate(self._numbers())
        ]

    def rows(self) -> Iterator[tuple[str, Iterator[Scene]]]:
        """Yield the disturbances, each with its scenes."""
        sheets = self.sheets()
        for name, exposure in exposures().items():
            yield name, self._exposed(sheets, exposure)
        for distance in (6.5, 5.5) if self.name in RING_NAMES else ():
            row = f'another target {distance} dot radii away'
            yield row, self._overlapping(distance)
        yield 'mirrored', self._mirrored(sheets)
        for distance in (3.2, 2.6):
            yield f'border of the image {distance} dot radii away', self._cut(distance)

    def _numbers(self) -> list[np.ndarray]:
        return random_numbers(self.name, self.count, self.seed, self.among)

    def _exposed(self, sheets: list[Sheet], exposure: Exposure) -> Iterator[Scene]:
        for sheet in sheets:
            yield sheet.photograph(exposure), sheet.truth

    def _overlapping(self, distance: float) -> Iterator[Scene]:
        """Yield sheets of half as many targets, each with another one on it."""
        below = replace(self, count=self.count // 2)
        for index, numbers in enumerate(below._numbers()):
            yield overlapping(self.name, numbers, self.seed + index, distance)

    def _mirrored(self, sheets: list[Sheet]) -> Iterator[Scene]:
        for sheet in sheets:
            image = np.ascontiguousarray(sheet.photograph(Exposure())[:, ::-1])
            last = image.shape[1] - 1
            yield image, [TrueTarget(it.id, last - it.x, it.y) for it in sheet.truth]

    def _cut(self, distance: float) -> Iterator[Scene]:
        """Yield rows of targets that each side of an image cuts at a distance from the centres."""
        numbers = np.concatenate(self._numbers())
        for index, start in enumerate(range(0, len(numbers), COLUMNS)):
            row = target_sheet(
                self.name,
                numbers[start : start + COLUMNS],
                self.seed + index,
                spread=0.0,
                bright=self.bright,
            )
            image, truth = row.photograph(Exposure()), row.truth
            height = round(len(image) / 2 + distance * RADIUS)
            image = image[:height]
            for _ in range(index % 4):
                last = image.shape[1] - 1
                image = np.rot90(image)
                truth = [TrueTarget(it.id, it.y, last - it.x) for it in truth]
            yield np.ascontiguousarray(image), truth
