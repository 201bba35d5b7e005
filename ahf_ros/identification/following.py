"""Targets that are followed from one image to the next.

Known targets are looked for near the places where the last image showed them, and read again there
by all evidence. How they moved tells how the image did. Where it shows something else than the
last one, moved alike, it is searched as any image is; so are the places of targets that could not
be read again, and, image by image, one part after the other of what seems not to have changed.
Where less than half of the targets are confirmed, the image is searched wholly, as the first one
was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ahf_ros.base.target import UNDECODED, Prints, Target, reach_of
from ahf_ros.families.contract import Confirmed
from ahf_ros.families.explained import MARGIN
from ahf_ros.identification.filtering.identifier import Seen
from ahf_ros.identification.filtering.trials import DetectorFunction
from ahf_ros.vision.faint_targets import displaced
from ahf_ros.vision.noise import usual_noise
from ahf_ros.vision.parts import Part, area, joined

_APART = 64  # rows, of which few tell that an image is another one
_AROUND = 1.6  # half the side of what is looked for again, in semi-axes of a target's ellipse
_FARTHEST = 1.5  # by which a target may have moved, in its semi-axes
_BESIDE = 2  # pixels of the smaller image by which targets move differently
_SEMI_AXIS = 5.0  # px; larger targets are looked for again in a smaller image
_LEAST = 0.5  # share of the known targets that are confirmed
_STILL = 0.3  # px; images that moved by less are compared as they are
_TELLING = 8  # targets that tell an affine movement, not only how far
_ACROSS = 0.05  # ratio of the width of where they are to its length, at the least
_NEAR, _PIXELS = 0.5, 2.0  # semi-axes, or px, between two places of one target
_TILE = 32  # side of what has changed or has not, px of the half
_CHANGED = 6  # pixels of a tile that show another image
_NOISE = 4.0  # deviations of noise beyond the gray values next to a pixel
_STEP = 3  # gray values, beside noise
_EVERY = 4  # pixels of the half, one of which tells how light has changed
_DARK = 16  # gray value below which steps of gray values are too coarse to tell it
_AT_LEAST = 32  # px about what has changed
_SIDE = 640  # px, usual side of a part that is searched though it seems not to have changed
_EACH = 100_000  # px, to which the search of a part amounts whatever its size is
_MOST, _FEW = 0.5, 50  # share of an image that is searched in parts, and their number


@dataclass(frozen=True, slots=True)
class Following:
    """From an image and what was seen in the one before it to the targets that it shows.

    Attributes
    ----------
    detector : callable
        From an image, or a part of one, to its targets.
    confirm : callable
        As `ahf_ros.families.contract.Confirming` has it.
    prints : mapping of str to FamilyRecord
        The families of targets by their names.
    interval : int
        Images in which each part of an image that has not changed is searched again.
    """

    detector: DetectorFunction
    confirm: Callable[[np.ndarray, Sequence[Target]], Confirmed]
    prints: Prints
    interval: int

    def __call__(self, image: np.ndarray, before: Seen) -> Seen:
        """Return what an image shows; the targets that were confirmed are marked as followed.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width)
        before : Seen
            In the image before.
        """
        if _is_still(before.image, image):
            return replace(before, still=before.still + 1)
        after = self._followed(image, before) if before.image.shape == image.shape else None
        # The caller may take the next image into the same array.
        return after or Seen(image.copy(), tuple(self.detector(image)))

    def _followed(self, image: np.ndarray, before: Seen) -> Seen | None:
        """Return what an image shows, None if it must be searched wholly."""
        known = [it for it in before.targets if it.id != UNDECODED]
        expected = _where(image, known)
        again = self.confirm(image, expected)
        confirmed = _alike(again.targets, expected)
        if len(confirmed) < _LEAST * len(known):
            return None
        followed = list(confirmed.values())
        movement = _movement([known[index] for index in confirmed], followed)
        height, width = image.shape
        lost = [it for index, it in enumerate(known) if index not in confirmed]
        lost += [*before.lost, *(it for it in before.targets if it.id == UNDECODED)]
        lost = [displaced(it, *(_to(movement, it) - (it.x, it.y))) for it in lost]
        lost = [it for it in lost if _holds((0, 0, width, height), it)]
        reach = max(map(self._reach, (*known, *lost)), default=0.0)
        turn = _part(image.shape, before.turn, self.interval)
        parts = [*self._places(lost, image.shape)]
        if turn:
            parts.append(_grown(turn, math.ceil(max(reach, _AT_LEAST)), image.shape))
        changed, entering = _changed(image, before.image, movement, reach)
        changes = [*self._changes(changed, followed, math.ceil(max(2 * reach, _AT_LEAST)))]
        for it in entering:
            changes += self._changes(it, followed, _AT_LEAST)
        parts += changes
        parts = joined(parts, _EACH) if len(parts) <= _FEW else parts
        if sum(map(area, parts)) > _MOST * image.size or len(parts) > _FEW:
            parts = [(0, 0, width, height)]
        found = again.search(parts) if parts else again.targets
        where = {it.print: it for it in followed}
        targets = tuple(
            replace(it, followed=it.print in where and _is_same(it, where[it.print]))
            for it in found
        )
        # What is lost is looked for in each image, until all of its part has been searched.
        prints = {it.print for it in targets}
        lost = [it for it in lost if it.print not in prints and not (turn and _holds(turn, it))]
        still = 0 if changes else before.still + 1
        return Seen(image.copy(), targets, tuple(lost), before.turn + 1, still)

    def _reach(self, target: Target) -> float:
        """Return the radius of a target with the blur of its edges, px."""
        return MARGIN * reach_of(target, self.prints) * target.semi_major

    def _places(self, lost: Iterable[Target], shape: tuple[int, int]) -> Iterator[Part]:
        """Yield the parts of an image in which targets are looked for that are lost."""
        for it in lost:
            x, y = round(it.x), round(it.y)
            yield _grown((x, y, x + 1, y + 1), math.ceil(2 * self._reach(it)), shape)

    def _changes(
        self, changed: np.ndarray, followed: Iterable[Target], margin: int
    ) -> Iterator[Part]:
        """Yield the parts of an image that changed beside its targets, with a margin."""
        for it in followed:
            centre = round((it.x - 0.5) / 2), round((it.y - 0.5) / 2)
            cv2.circle(changed, centre, math.ceil(self._reach(it) / 2), 0, cv2.FILLED)
        height, width = changed.shape
        padded = np.pad(changed, ((0, -height % _TILE), (0, -width % _TILE)))
        rows, columns = (side // _TILE for side in padded.shape)
        counts = padded.reshape(rows, _TILE, columns, _TILE).sum(axis=(1, 3), dtype=int)
        tiles = (counts >= _CHANGED).astype(np.uint8)
        _, _, found, _ = cv2.connectedComponentsWithStats(tiles, connectivity=8)
        for left, top, across, down, _ in (2 * _TILE * found[1:]).tolist():
            part = left, top, left + across, top + down
            yield _grown(part, margin, (2 * height, 2 * width))


def _is_still(before: np.ndarray, image: np.ndarray) -> bool:
    """Return whether two images are the same; most that are not differ in any few rows."""
    return all(np.array_equal(before[rows], image[rows]) for rows in (np.s_[::_APART], np.s_[:]))


def _where(image: np.ndarray, known: Sequence[Target]) -> list[Target]:
    """Return targets of the image before where this one shows their dots, to a pixel or two.

    A pattern of light hides the dots of some, but does not move all of them alike.
    """
    if not known:
        return []
    minor, major = np.median([(it.semi_minor, it.semi_major) for it in known], axis=0)
    size = 2 ** max(0, math.floor(math.log2(max(minor, 1.0) / _SEMI_AXIS) + 0.5))
    reach = max(_BESIDE + 1, math.ceil(_FARTHEST * major / size))
    side = 2 * reach + 1
    likeness = np.full((len(known), side, side), np.nan, np.float32)
    for of, it in zip(likeness, known, strict=True):
        half = math.ceil(_AROUND * it.semi_major / size)
        x, y = (math.floor((of + 0.5) / size) for of in (it.x, it.y))
        around = _cut(image, x, y, half + reach, size)
        if around is not None:
            of[:] = cv2.matchTemplate(around, _dot(it, x, y, half, size), cv2.TM_CCOEFF_NORMED)
    told = np.isfinite(likeness).all(axis=(1, 2))
    if not told.any():
        return list(known)
    beside = np.ones((3, 3), np.uint8)
    common = np.mean([cv2.dilate(it, beside) for it in likeness[told]], axis=0)
    row, column = divmod(int(common.argmax()), side)
    row, column = (min(max(it, _BESIDE), side - 1 - _BESIDE) for it in (row, column))
    near = np.s_[:, row - _BESIDE : row + _BESIDE + 1, column - _BESIDE : column + _BESIDE + 1]
    best = (likeness[told] + common)[near].reshape(told.sum(), -1).argmax(axis=1)
    moved = np.empty((len(known), 2), int)
    moved[told] = np.column_stack([best % (2 * _BESIDE + 1), best // (2 * _BESIDE + 1)])
    moved[~told] = np.rint(np.median(moved[told], axis=0))
    moved += np.array([column, row]) - _BESIDE - reach
    return [displaced(it, *of) for it, of in zip(known, (size * moved).tolist(), strict=True)]


def _dot(target: Target, x: int, y: int, half: int, size: int) -> np.ndarray:
    """Return the dot of a target in even light, in the square about a pixel; see `_cut`."""
    side, lit = 2 * half + 1, 127 + 64 * target.polarity
    shown = np.full((side, side), lit, np.uint8)
    centre = half + (target.x + 0.5) / size - 0.5 - x, half + (target.y + 0.5) / size - 0.5 - y
    axes = 2 * target.semi_major / size, 2 * target.semi_minor / size
    cv2.ellipse(shown, (centre, axes, math.degrees(target.angle)), 255 - lit, cv2.FILLED)
    return shown


def _cut(image: np.ndarray, x: int, y: int, half: int, size: int) -> np.ndarray | None:
    """Return the square about a pixel of an image that is reduced by `size`, None at its edge."""
    left, top = (of - half for of in (x, y))
    right, bottom = (of + half + 1 for of in (x, y))
    height, width = image.shape
    if left < 0 or top < 0 or right * size > width or bottom * size > height:
        return None
    part = image[top * size : bottom * size, left * size : right * size]
    side = 2 * half + 1
    return cv2.resize(part, (side, side), interpolation=cv2.INTER_AREA) if size > 1 else part


def _alike(found: Iterable[Target], expected: Sequence[Target]) -> dict[int, Target]:
    """Return which targets were found with their print where they were expected, by index."""
    prints: dict[tuple[str, int, int], int] = {}
    for index, it in enumerate(expected):
        prints[it.print] = index
    confirmed: dict[int, Target] = {}
    for it in found:
        index = prints.get(it.print, -1)
        if index >= 0 and _is_same(it, expected[index]):
            confirmed[index] = it
    return confirmed


def _is_same(one: Target, other: Target) -> bool:
    """Return whether two readings are of one target."""
    near = math.hypot(one.x - other.x, one.y - other.y) < max(_NEAR * other.semi_major, _PIXELS)
    return near and one.print == other.print


def _movement(old: Sequence[Target], new: Sequence[Target]) -> np.ndarray:
    """Return the affine map, (2, 3), from the image before that targets tell."""
    if not old:
        return np.eye(2, 3)
    start, end = (np.array([(it.x, it.y) for it in of]) for of in (old, new))
    moved = end - start
    shift, about = np.median(moved, axis=0), start.mean(axis=0)
    linear = np.zeros((2, 2))
    if len(old) >= _TELLING:  # along a line that all are on, nothing is told across it
        linear = np.linalg.lstsq(start - about, moved - moved.mean(axis=0), rcond=_ACROSS)[0].T
        shift = moved.mean(axis=0)
    return np.column_stack([np.eye(2) + linear, shift - linear @ about])


def _to(movement: np.ndarray, target: Target) -> np.ndarray:
    """Return where a movement brings the centre of a target, (2,)."""
    return movement @ (target.x, target.y, 1.0)


def _moved(image: np.ndarray, movement: np.ndarray) -> np.ndarray:
    """Return an image after a movement."""
    if np.abs(_of_corners(image.shape, movement)).max() < _STILL:
        return image
    height, width = image.shape
    return cv2.warpAffine(image, movement, (width, height), borderMode=cv2.BORDER_REPLICATE)


def _of_corners(shape: tuple[int, ...], movement: np.ndarray) -> np.ndarray:
    """Return by how much the corners of an image move, px, (4, 2)."""
    height, width = shape
    corners = np.array([(0, 0, 1), (width, 0, 1), (0, height, 1), (width, height, 1)])
    return corners @ movement.T - corners[:, :2]


def _changed(
    image: np.ndarray, before: np.ndarray, movement: np.ndarray, reach: float
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return where the half of an image is not what it was, or lies next to it; uint8, 1 or 0.

    Light may be brighter or darker as a whole, as that of lamps in the beat of the mains, or to
    another exposure. Along each side that moves into the image, all that is there is new, as far
    as targets reach that are only now seen as a whole: the second result has a mask for each.
    """
    height, width = image.shape
    now, then = (
        cv2.resize(it, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        for it in (image, _moved(before, movement))
    )
    least = np.rint(np.arange(256) * _gain(now, then)).clip(0, 255).astype(np.uint8)
    most = np.append(least[:-1], np.uint8(255))  # of what may have been brighter than white
    beside = np.ones((3, 3), np.uint8)
    above = cv2.subtract(now, cv2.dilate(cv2.LUT(then, most), beside))
    below = cv2.subtract(cv2.erode(cv2.LUT(then, least), beside), now)
    difference = cv2.max(above, below)
    limit = _NOISE * usual_noise(now) + _STEP
    deep = math.ceil(reach)  # px of the half, twice as far
    entering = []
    for strip in _entering(image.shape, movement, deep):
        shown = now[strip]
        difference[strip], beyond = 0, np.zeros_like(now)
        beyond[strip] = cv2.subtract(cv2.dilate(shown, beside), cv2.erode(shown, beside))
        entering.append(_over(beyond, limit))
    return _over(difference, limit), entering


def _entering(
    shape: tuple[int, ...], movement: np.ndarray, deep: int
) -> Iterator[tuple[slice, ...]]:
    """Yield the strips, of a depth in px, along the sides of which a corner moves inwards."""
    (x, y) = _of_corners(shape, movement).T
    if max(x[0], x[2]) > _STILL:
        yield np.s_[:, :deep]
    if min(x[1], x[3]) < -_STILL:
        yield np.s_[:, -deep:]
    if max(y[0], y[1]) > _STILL:
        yield np.s_[:deep, :]
    if min(y[2], y[3]) < -_STILL:
        yield np.s_[-deep:, :]


def _over(values: np.ndarray, limit: float) -> np.ndarray:
    """Return where values are over a limit, uint8, 1 or 0."""
    return cv2.threshold(values, limit, 1, cv2.THRESH_BINARY)[1]


def _gain(now: np.ndarray, then: np.ndarray) -> float:
    """Return by how much all gray values have grown, as a factor."""
    now, then = (it[::_EVERY, ::_EVERY] for it in (now, then))
    telling = (then >= _DARK) & (np.maximum(now, then) < 255)
    ratios = np.divide(now[telling], then[telling], dtype=np.float32)
    return float(np.median(ratios)) if ratios.size else 1.0


def _part(shape: tuple[int, int], turn: int, interval: int) -> Part | None:
    """Return the part of an image whose turn it is, None if this image is to have none.

    The turns of as many parts as are worth it are spread over the images of an interval.
    """
    height, width = shape
    columns = max(1, min(round(math.sqrt(interval * width / height)), round(width / _SIDE)))
    rows = max(1, min(interval // columns, round(height / _SIDE)))
    number, since = divmod(turn % interval * rows * columns, interval)
    if since >= rows * columns:
        return None
    row, column = divmod(number, columns)
    left, right = (width * it // columns for it in (column, column + 1))
    top, bottom = (height * it // rows for it in (row, row + 1))
    return left, top, right, bottom


def _holds(part: Part, target: Target) -> bool:
    return part[0] <= target.x < part[2] and part[1] <= target.y < part[3]


def _grown(part: Part, margin: int, shape: tuple[int, int]) -> Part:
    """Return a part of an image with a margin about it."""
    left, top, right, bottom = part
    height, width = shape
    return (
        max(left - margin, 0),
        max(top - margin, 0),
        min(right + margin, width),
        min(bottom + margin, height),
    )
