"""Whether the scene moved between two images, though the light on it changed.

A print has the same steps of the logarithm in any light. So an edge of the first image is looked
for in the second one, along its normal, with the same direction and about the same step. Edges of
light that moved find no such partner in the same place, or find it displaced along their normal
only. A scene that rests shows as a peak of coincidences at no displacement; its distance from zero
is measured against its own uncertainty. Where nothing coincides at zero, but much does at another
displacement, the scene moved by this. A pattern of light may look like that, so targets are
witnesses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.vision.image import as_gray
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.resampling import remapped

_SIGNIFICANT = 6.0  # standard deviations from zero, a displacement that is movement
_MINIMUM_EDGES = 60  # that coincide, for a displacement to be measured
_WINDOW = 2  # px, maximum distance of an edge from its place along its normal
_PEAK = 1.5  # ratio of coincidences in a peak to those beside it, or in another peak
_BINS = 4  # per px, of displacements along a normal
_NEAR = 0.75  # px, a displacement that is refined
_RING = 1.25  # px, distance from a peak at which it has fallen
_STEPS = 8  # of the robust fit
_DIRECTIONS = 12  # of normals, which count alike: light has few, prints have many
_STRIPED = 2.5  # ratio of edges in a direction to the median of all directions
_ENOUGH = 120  # edges of other directions
_UNEVEN = 0.1  # px, systematic error where no edge of the first image coincides
_REACH = 16  # px of an image and of smaller ones of it, maximum displacement that is looked for
_MINIMUM_SHIFT = 0.05  # px, of a scene, that counts: uneven light moves edges by as much
_MINIMUM_PART_SHIFT = 0.7  # px, of a part of the scene, that counts
_BLUR = 1.0  # px, of the logarithm; edges become as wide in sharp images as in soft ones
_STEEP = 0.06  # of ln per px, an edge; paper is flatter
_NOISY = 6.0  # standard deviations of the gradient in flat parts, an edge
_FLAT, _FLAT_SIZE = 10, 0.459  # percentile of gradients that are noise, and its deviations
_MAXIMUM_EDGES = 20_000  # evenly distributed ones are enough, and remap takes 32,767
_SIMILAR = 1.5  # ratio of two steps that may be the same edge
_FAR_EDGES = 4000  # are enough to look for a displacement of whole pixels
_COARSE = 4  # times smaller image, in which larger displacements are looked for
_MINIMUM_SIDE = 100  # px, side of such an image
_SHORT = 2.0  # px in it, a displacement that the whole image would show
_APART = 3.0  # px, between two peaks
_TILES = 4  # along each side, that are looked at one by one

Gradients = tuple[np.ndarray, np.ndarray]
"""Of an image along x and y, float32, shape (height, width)."""


_MINIMUM_TARGETS = 3  # targets that are in both images
_STAYED = 0.5  # of a displacement: targets that moved less stayed where they were
_MOVED_BY_LIGHT = 0.3  # px, by which light moves the centres of targets that stayed
_SIGNIFICANT_MEDIAN = 4.0  # standard deviations of the median, a movement
_OF_MEDIAN = 1.4826 * 1.2533  # from the median deviation to the deviation of the median of one


@dataclass(frozen=True, slots=True)
class Displacement:
    """A displacement of a scene between two images and the deviation of its length, px.

    `region` is the part of the image that shows it: its edges left, top, right and bottom, px.
    """

    x: float
    y: float
    deviation: float
    region: tuple[float, float, float, float] = (-np.inf, -np.inf, np.inf, np.inf)

    def covers(self, x: float, y: float) -> bool:
        """Return whether a point is in the region."""
        left, top, right, bottom = self.region
        return left <= x < right and top <= y < bottom

    def exceeds(self, minimum: float) -> bool:
        """Return whether it is longer than a minimum, and significant."""
        return bool(np.hypot(self.x, self.y) > max(minimum, _SIGNIFICANT * self.deviation))

    def __str__(self) -> str:
        """Return the length with its standard deviation."""
        return f'{np.hypot(self.x, self.y):.2f} px (standard deviation {self.deviation:.3f} px)'


def _measured(normals: np.ndarray, found: np.ndarray) -> Displacement | None:
    """Return the displacement at which edges coincide, None where none stands out.

    `normals` are unit vectors, float32, shape (n, 2). `found` has where along its normal each edge
    is seen again, px, float32, shape (n, m), NaN where it is not.
    """
    if len(normals) < _MINIMUM_EDGES:
        return None
    weights = _direction_weights(normals)
    peak = _peak(normals, weights, _seen(found))
    return None if peak is None else _refined(normals, weights, found, peak)


def _direction_weights(normals: np.ndarray) -> np.ndarray:
    """Return weights of edges, 1 on average, with which all directions count alike.

    Directions with many times more edges than others are stripes of light. They and their
    neighbours are left out where enough edges remain.
    """
    angles = np.arctan2(normals[:, 1], normals[:, 0])
    classes = np.floor((angles / (2 * np.pi) + 0.5) * _DIRECTIONS).astype(int) % _DIRECTIONS
    counts = np.bincount(classes, minlength=_DIRECTIONS)
    least = len(normals) / (4 * _DIRECTIONS)
    weights: np.ndarray = 1 / np.maximum(counts, least)[classes]
    striped = counts > _STRIPED * np.median(counts)
    striped |= np.roll(striped, 1) | np.roll(striped, -1)
    if counts[~striped].sum() >= _ENOUGH:
        weights[striped[classes]] = 0.0
    return weights / weights.mean()


def _seen(found: np.ndarray) -> np.ndarray:
    """Return whether an edge is seen again near each displacement, shape (n, bins)."""
    edges, bins = len(found), 2 * (_WINDOW + 1) * _BINS + 1
    seen = np.zeros((edges, bins), bool)
    rows, columns = np.nonzero(~np.isnan(found))
    middle = np.rint((found[rows, columns] + _WINDOW + 1) * _BINS).astype(int)
    for beside in (-1, 0, 1):
        seen[rows, np.clip(middle + beside, 0, bins - 1)] = True
    return seen


def _coincidences(
    normals: np.ndarray, weights: np.ndarray, seen: np.ndarray, shifts: np.ndarray
) -> np.ndarray:
    """Return how many edges are seen again at each displacement, shape (shifts,)."""
    bins = np.rint((normals @ shifts.T + _WINDOW + 1) * _BINS).astype(int)
    return np.array([weights @ np.take_along_axis(seen, of[:, None], 1)[:, 0] for of in bins.T])


def _peak(normals: np.ndarray, weights: np.ndarray, seen: np.ndarray) -> np.ndarray | None:
    """Return the displacement of most coincidences, None where none stands out."""
    side = np.arange(-_NEAR, _NEAR + 0.1, 1 / _BINS)
    grid = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    counts = _coincidences(normals, weights, seen, grid)
    best = grid[counts.argmax()]
    angles = np.arange(12) * (np.pi / 6)
    ring = best + _RING * np.stack((np.cos(angles), np.sin(angles)), 1)
    beside = _coincidences(normals, weights, seen, ring)
    enough = counts.max() >= max(_MINIMUM_EDGES, _PEAK * beside.max())
    return best if enough else None


def _refined(
    normals: np.ndarray, weights: np.ndarray, found: np.ndarray, start: np.ndarray
) -> Displacement:
    """Return a displacement fitted to the coincidences around it, robustly."""
    shift, width = start.astype(float), 0.5
    variance, share = np.inf, 0.0
    for _ in range(_STEPS):
        off = found - (normals @ shift).astype(np.float32)[:, None]
        off = np.where(np.isnan(off), np.inf, off)
        nearest = np.take_along_axis(off, np.abs(off).argmin(1)[:, None], 1)[:, 0]
        close = np.abs(nearest) < width
        if close.sum() < _MINIMUM_EDGES:
            break
        rest, of = nearest[close], normals[close]
        robust = weights[close] * (1 - (rest / width) ** 2) ** 2
        weighted = of * robust[:, None]
        normal_matrix = weighted.T @ of
        shift += np.linalg.solve(normal_matrix, weighted.T @ rest)
        spread = 1.4826 * float(np.median(np.abs(rest)))
        inverse = np.linalg.inv(normal_matrix)
        middle = (of * robust[:, None] ** 2).T @ of
        variance = spread**2 * float(np.trace(inverse @ middle @ inverse))
        share = float(weights[close].sum() / weights.sum())
        width = max(min(width, 4 * spread), 0.1)
    deviation = float(np.sqrt(variance + (_UNEVEN * (1 - share)) ** 2))
    return Displacement(float(shift[0]), float(shift[1]), deviation)


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Edges of an image, ready to be looked for in others; arrays are of float32.

    n edges are at the pixels `x` and `y`, have unit vectors `normals` from dark to bright, shape
    (n, 2), gradients `steps` of the logarithm, 1 / px, and exact `places` along the normals, px.
    `shape` is that of the image, and `gradients` are those of its logarithm along x and y, 1 / px.
    `coarse` are the edges of the image at a quarter of its size, None where that is too small.
    """

    x: np.ndarray
    y: np.ndarray
    normals: np.ndarray
    steps: np.ndarray
    places: np.ndarray
    shape: tuple[int, int]
    gradients: Gradients
    coarse: Edges | None


def find_edges(image: np.ndarray) -> Edges:
    """Return the edges of an image that `ahf_ros.vision.image.check_image` accepts."""
    gradients = _gradients(image)
    size = cv2.magnitude(*gradients)
    flat = float(np.percentile(size[::4, ::4], _FLAT)) / _FLAT_SIZE
    minimum = max(_STEEP, _NOISY * flat)
    inside = np.zeros(size.shape, bool)
    margin = _REACH + 2
    inside[margin:-margin, margin:-margin] = True
    crest = np.zeros(size.shape, bool)
    for beside in ((3, 1), (1, 3)):
        crest |= size >= cv2.dilate(size, np.ones(beside))
    y, x = np.nonzero((size > minimum) & crest & inside)
    every = -(-len(x) // _MAXIMUM_EDGES) or 1
    y, x = y[::every], x[::every]
    normals = np.stack([of[y, x] for of in gradients], 1) / size[y, x, None]
    profiles = _profiles(gradients, x, y, normals, np.arange(-1.0, 2.0))
    places, steps = _vertex(*profiles.T)
    good = np.abs(places) < 1
    x, y, normals, steps, places = (of[good] for of in (x, y, normals, steps, places))
    coarse = find_edges(_reduced(image)) if min(size.shape) >= _COARSE * _MINIMUM_SIDE else None
    return Edges(
        x=x.astype(np.float32),
        y=y.astype(np.float32),
        normals=normals,
        steps=steps,
        places=places,
        shape=size.shape,
        gradients=gradients,
        coarse=coarse,
    )


@one_blas_thread()
def displacement(edges: Edges, image: np.ndarray) -> Displacement | None:
    """Return by how much a scene moved, None where nothing shows that it did.

    The edges are those of the first image, and the other image has the same size.
    """
    if len(edges.x) < _MINIMUM_EDGES:
        return None
    gradients = _gradients(image)
    found = _partners(edges, gradients)
    whole = _measured(edges.normals, found)
    if whole is None:
        return _far(edges, gradients) or _coarse(edges, image)
    if whole.exceeds(_MINIMUM_SHIFT):
        return whole
    height, width = edges.shape
    tile = (edges.y * _TILES // height) * _TILES + edges.x * _TILES // width
    for number in range(_TILES**2):
        part = _measured(edges.normals[tile == number], found[tile == number])
        if part and part.exceeds(_MINIMUM_PART_SHIFT):
            row, column = divmod(number, _TILES)
            left, top = column * width / _TILES, row * height / _TILES
            region = left, top, left + width / _TILES, top + height / _TILES
            return replace(part, region=region)
    return None


def _coarse(edges: Edges, image: np.ndarray) -> Displacement | None:
    """Return a displacement that is found at a quarter of the size, None if it is short."""
    found = displacement(edges.coarse, _reduced(image)) if edges.coarse else None
    if found is None or not found.exceeds(_SHORT):
        return None
    return Displacement(_COARSE * found.x, _COARSE * found.y, _COARSE * found.deviation)


def _reduced(image: np.ndarray) -> np.ndarray:
    height, width = image.shape
    size = width // _COARSE, height // _COARSE
    return cv2.resize(as_gray(image), size, interpolation=cv2.INTER_AREA)


def _gradients(image: np.ndarray) -> Gradients:
    logarithm = np.log(as_gray(image).astype(np.float32) + np.float32(LOG_OFFSET))
    smooth = cv2.GaussianBlur(logarithm, (0, 0), _BLUR)
    across = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1 / 32)
    return across, cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1 / 32)


def _profiles(
    gradients: Gradients, x: np.ndarray, y: np.ndarray, normals: np.ndarray, offsets: np.ndarray
) -> np.ndarray:
    """Return the gradient along each normal at offsets from the edge, shape (n, offsets)."""
    columns = (x[:, None] + normals[:, :1] * offsets).astype(np.float32)
    rows = (y[:, None] + normals[:, 1:] * offsets).astype(np.float32)
    if not len(x):
        return columns
    across, down = (remapped(of, columns, rows, cv2.BORDER_CONSTANT) for of in gradients)
    return across * normals[:, :1] + down * normals[:, 1:]


def _vertex(
    before: np.ndarray, middle: np.ndarray, after: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return place and height of the vertex of a parabola through three values."""
    bend = np.maximum(2 * middle - before - after, 1e-9)
    place = (after - before) / (2 * bend)
    return place, middle + bend * place**2 / 2


def _partners(edges: Edges, gradients: Gradients, x: int = 0, y: int = 0) -> np.ndarray:
    """Return where along its normal each edge is seen again, from a place x and y px away.

    Shape (n, 2 * _WINDOW + 1), px; the maximum near each whole offset, else NaN.
    """
    offsets = np.arange(-_WINDOW - 1.0, _WINDOW + 2.0)
    along = _profiles(gradients, edges.x + x, edges.y + y, edges.normals, offsets)
    middle = along[:, 1:-1]
    place, height = _vertex(along[:, :-2], middle, along[:, 2:])
    good = (middle >= along[:, :-2]) & (middle > along[:, 2:])
    good &= _alike(height, edges.steps[:, None])
    found = offsets[1:-1] + place - edges.places[:, None]
    return np.where(good, found, np.nan).astype(np.float32)


def _alike(steps: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether two steps may belong to one edge."""
    return (steps > others / _SIMILAR) & (steps < others * _SIMILAR)


def _counts(edges: Edges, gradients: Gradients, reach: int) -> np.ndarray:
    """Return how many edges are seen again at each displacement (y, x) from -`reach` on, px."""
    every = slice(None, None, -(-len(edges.x) // _FAR_EDGES))
    x, y = (of[every].astype(int) for of in (edges.x, edges.y))
    normals, steps = edges.normals[every], edges.steps[every]
    weights = _direction_weights(normals)
    height, width = edges.shape
    counts = np.zeros((2 * reach + 1, 2 * reach + 1))
    for row in range(len(counts)):
        rows = np.clip(y + row - reach, 0, height - 1)
        for column in range(len(counts)):
            at = rows, np.clip(x + column - reach, 0, width - 1)
            along = gradients[0][at] * normals[:, 0] + gradients[1][at] * normals[:, 1]
            counts[row, column] = weights @ _alike(along, steps)
    return counts


def _single_peak(counts: np.ndarray) -> tuple[int, int] | None:
    """Return the place of the highest count, None unless it stands out from those apart."""
    row, column = divmod(int(counts.argmax()), len(counts))
    rows, columns = np.indices(counts.shape)
    apart = np.hypot(rows - row, columns - column) >= _APART
    return (row, column) if counts.max() >= _PEAK * counts[apart].max() else None


def _far(edges: Edges, gradients: Gradients) -> Displacement | None:
    """Return a displacement of more than a pixel, None unless just one stands out.

    A pattern of light that moved is like itself at several displacements, and so is the image.
    """
    counts = _counts(edges, gradients, _REACH)
    peak = _single_peak(counts)
    if not peak or counts.max() < _MINIMUM_EDGES:
        return None
    if not _single_peak(_counts(edges, edges.gradients, 2 * _REACH)):
        return None
    x, y = peak[1] - _REACH, peak[0] - _REACH
    rest = _measured(edges.normals, _partners(edges, gradients, x, y))
    return Displacement(rest.x + x, rest.y + y, rest.deviation) if rest else None


def targets_moved(
    moved: Displacement, before: Sequence[Target], after: Sequence[Target]
) -> bool | None:
    """Return whether targets moved that two images show; None if too few of them tell.

    Only targets count that are where the displacement was seen.
    """
    others = {it.print: it for it in after if it.id != UNDECODED}
    shifts = np.array(
        [
            (others[it.print].x - it.x, others[it.print].y - it.y)
            for it in before
            if it.print in others and moved.covers(it.x, it.y)
        ]
    )
    if len(shifts) < _MINIMUM_TARGETS:
        return None
    middle = np.median(shifts, axis=0)
    spread = np.median(np.abs(shifts - middle), axis=0) * _OF_MEDIAN / np.sqrt(len(shifts))
    length, limit = np.hypot(*middle), min(_STAYED * np.hypot(moved.x, moved.y), _MOVED_BY_LIGHT)
    deviation = np.hypot(*spread)
    if length > limit:
        return True if length > _SIGNIFICANT_MEDIAN * deviation else None
    return False if deviation < limit else None
