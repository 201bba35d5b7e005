"""The beginning of a network: three photographs that determine each other, and the focal length.

Two photographs of a plane have two relative orientations and fit any focal length; three do not.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ahf_ros.network import image_points
from ahf_ros.network.camera import known_calibration, pinhole
from ahf_ros.network.image_points import BEHIND
from ahf_ros.network.least_squares import precision
from ahf_ros.network.network import CameraView, FloatArray, IntArray, Network, part_of
from ahf_ros.network.planar import mirrored
from ahf_ros.network.refinement import free_parameters, lengths_of, refine, spread_of, usual_lens
from ahf_ros.network.relative import relative_orientations
from ahf_ros.network.resection import resections
from ahf_ros.network.solution import NetworkState
from ahf_ros.network.triangulation import SMALLEST_ANGLE, directions, midpoints
from ahf_ros.network.views import View, largest_angles

STEPS = np.geomspace(0.5, 4.0, 14)
"""Focal lengths that are tried where none is known, in widths of the image: 17 % apart."""

FISHEYE = 0.4
"""Those of fisheye lenses over those of others."""

FEWEST_COMMON = 6
MOST_PHOTOGRAPHS = 40
MOST_TRIPLES = 9
AT_A_TIME = 3

LENS = (('f', 'k1'), ('f', 'k1', 'k2', 'cx', 'cy'))
"""What is released of lenses while residuals exceed their standard deviations."""

UNEXPLAINED = 2.0
"""Robust spread of residuals in standard deviations that a lens may explain."""

MOST_AGREE = 0.9
"""Share of observations below which a lens may explain why the others do not agree."""

WEAK = 0.2
"""Relative standard deviation of a focal length that is hardly determined."""

BOUND = 4.0
"""Standard deviations to which a residual counts."""


def focal_steps(view: CameraView) -> FloatArray:
    """Return focal lengths in px that are tried of a camera of which nothing is known."""
    return STEPS * max(view.width, view.height) * (FISHEYE if view.equidistant else 1)


@dataclass(frozen=True)
class Seed:
    """Approximate values of a few photographs.

    `spread` is the robust standard deviation of the residuals in units of the given ones, `angle`
    the median over points of the largest angle of their rays in rad, and `focal_sigma` the
    standard deviation of the focal length over itself, zero where it is known.
    """

    photographs: tuple[int, ...]
    state: NetworkState
    spread: float
    cost: float
    angle: float
    focal_sigma: float

    @property
    def rank(self) -> float:
        """The smaller the better: uncertain points and an uncertain focal length."""
        number = int(np.isfinite(self.state.points[:, 0]).sum())
        precision = self.spread / (min(self.angle, 0.8) * np.sqrt(number))
        return float(precision * (1 + (self.focal_sigma / 0.02) ** 2))


def known_calibrations(network: Network) -> FloatArray:
    """Return what is given of the cameras (cameras, parameters)."""
    return np.array([known_calibration(view) for view in network.cameras])


def seeds(network: Network, views: Sequence[View], among: Sequence[int]) -> Iterator[Seed]:
    """Yield approximate values of triples of the photographs `among`.

    Triples come in the order of what their image points promise, a few at a time, and of these
    the best first; those that hardly determine the focal length come last.
    """
    known = known_calibrations(network)
    triples = _triples(views, among, np.isfinite(known[:, 0]))
    weak: list[Seed] = []
    for begin in range(0, len(triples), AT_A_TIME):
        found: list[Seed] = []
        for triple in triples[begin : begin + AT_A_TIME]:
            found += _seeds_of(network, views, triple, known)
        found.sort(key=lambda seed: seed.rank)
        weak += [seed for seed in found if seed.focal_sigma > WEAK]
        yield from (seed for seed in found if seed.focal_sigma <= WEAK)
    yield from sorted(weak, key=lambda seed: seed.rank)


def _triples(
    views: Sequence[View], among: Sequence[int], known: FloatArray
) -> list[tuple[int, int, int]]:
    """Return triples with many common points under different perspective, the best first.

    At most one camera of a triple may be without a focal length.
    """
    most = sorted(among, key=lambda index: (-len(views[index].points), index))[:MOST_PHOTOGRAPHS]
    worth: dict[tuple[int, int], float] = {}
    for a, b in combinations(sorted(most), 2):
        value = _worth(views[a], views[b])
        if value > 0:
            worth[a, b] = value
    pairs = sorted(worth, key=lambda pair: (-worth[pair], pair))[:60]
    rated: dict[tuple[int, int, int], float] = {}
    for a, b in pairs:
        for c in most:
            low, middle, high = sorted((a, b, c))
            triple = low, middle, high
            if c in (a, b) or triple in rated:
                continue
            unknown = {views[index].camera for index in triple}
            if sum(not known[camera] for camera in unknown) > 1:
                continue
            common = _common(views, triple)
            sides = [worth.get(pair, 0.0) for pair in combinations(triple, 2)]
            if common >= FEWEST_COMMON and min(sides) > 0:
                share = 1 - np.exp(-common / 15)
                rated[triple] = share * float(np.sum(np.sqrt(sides)))
    chosen: list[tuple[int, int, int]] = []
    for triple in sorted(rated, key=lambda one: (-rated[one], one)):
        if all(len(set(triple) & set(other)) < 2 for other in chosen):
            chosen.append(triple)
    rest = [one for one in sorted(rated, key=lambda one: (-rated[one], one)) if one not in chosen]
    return (chosen + rest)[:MOST_TRIPLES]


def _common(views: Sequence[View], triple: Sequence[int]) -> int:
    """Return the number of points that all three photographs show."""
    a, b, c = (views[index].points for index in triple)
    return len(np.intersect1d(np.intersect1d(a, b, True), c, True))


def _worth(first: View, second: View) -> float:
    """Return how much two photographs differ by more than a movement in the image, from 0 to 1.

    An affine map between them leaves parallax and perspective as residuals, and its two stretches
    differ where a plane is seen from different sides. Neither needs a focal length.
    """
    _, a, b = np.intersect1d(first.points, second.points, True, return_indices=True)
    if len(a) < FEWEST_COMMON:
        return 0.0
    source, target = first.xy[a], second.xy[b]
    source, target = source - np.median(source, axis=0), target - np.median(target, axis=0)
    size = np.median(np.linalg.norm(target, axis=1))
    system = np.column_stack([source, np.ones(len(source))])
    for _ in range(2):
        solution = np.linalg.lstsq(system, target, rcond=None)[0]
        rest = np.linalg.norm(target - system @ solution, axis=1)
        good = rest <= 4 * np.median(rest) + 1e-9
        system, target = system[good], target[good]
    stretches = np.linalg.svd(solution[:2], compute_uv=False)
    if size <= 0 or stretches[1] <= 0:
        return 0.0
    differs = np.median(rest) / size + 0.3 * np.log(stretches[0] / stretches[1])
    return float(min(differs, 0.5) * (1 - np.exp(-len(a) / 15)) + 1e-6)


@dataclass(frozen=True)
class _Hypothesis:
    score: float
    state: NetworkState


def _seeds_of(
    network: Network, views: Sequence[View], triple: tuple[int, int, int], known: FloatArray
) -> list[Seed]:
    """Return the approximate values that three photographs allow."""
    part, rows = part_of(network, np.array(triple))
    cameras = sorted({views[index].camera for index in triple})
    unknown = [camera for camera in cameras if not np.isfinite(known[camera, 0])]
    own = [views[index] for index in triple]
    if unknown:
        hypotheses = _scanned(part, own, known, unknown[0])
    else:
        hypotheses = sorted(_hypotheses(part, own, known), key=lambda one: one.score)[:4]
    found: list[Seed] = []
    for hypothesis in hypotheses:
        seed = _refined(part, hypothesis.state, triple, unknown)
        if seed is None:
            continue
        found.append(seed)
        if unknown and not _unexplained(part, seed.state):
            break  # other focal lengths explain no more
    if found:
        best = min(found, key=lambda one: one.cost)
        seed = _refined(part, mirrored(best.state), triple, unknown)
        found += [seed] if seed is not None else []
    return [_whole(network, seed, rows) for seed in _different(found)]


def _different(found: list[Seed]) -> list[Seed]:
    """Return the seed of least cost and those that fit about as well and are not the same."""
    found = sorted(found, key=lambda seed: seed.cost)
    kept: list[Seed] = []
    for seed in found:
        near = not kept or seed.cost < 1.5 * kept[0].cost + 10 * kept[0].spread ** 2
        if near and not any(_same(seed, other) for other in kept):
            kept.append(seed)
    return kept[:2]


def _same(seed: Seed, other: Seed) -> bool:
    """Return whether two seeds have the same relative rotations, to half a degree."""
    turns = seed.state.rotations[1:] @ seed.state.rotations[0].T
    others = other.state.rotations[1:] @ other.state.rotations[0].T
    cosines = (np.einsum('kij,kij->k', turns, others) - 1) / 2
    return bool(np.all(cosines > np.cos(np.radians(0.5))))


def _scanned(
    part: Network, own: Sequence[View], known: FloatArray, camera: int
) -> list[_Hypothesis]:
    """Return the best hypotheses at the local minima over the focal length."""
    view = part.cameras[camera]
    steps: list[_Hypothesis | None] = []
    for focal in focal_steps(view):
        calibrations = known.copy()
        calibrations[camera] = pinhole(focal, view.width, view.height)
        steps.append(
            min(_hypotheses(part, own, calibrations), key=lambda one: one.score, default=None)
        )
    scores = np.array([np.inf if one is None else one.score for one in steps])
    padded = np.concatenate([[np.inf], scores, [np.inf]])
    lowest = np.flatnonzero((scores <= padded[:-2]) & (scores <= padded[2:]) & np.isfinite(scores))
    best = lowest[np.argsort(scores[lowest], kind='stable')][:3]
    return [one for one in (steps[index] for index in best) if one is not None]


def _hypotheses(
    part: Network, own: Sequence[View], calibrations: FloatArray
) -> Iterator[_Hypothesis]:
    """Yield starts of three photographs: two by relative orientation, the third by resection."""
    first, second, third = own
    xy, sigma = zip(*(view.normalised(calibrations) for view in own), strict=True)
    _, a, b = np.intersect1d(first.points, second.points, True, return_indices=True)
    typical = float(np.median(np.concatenate([sigma[0][a], sigma[1][b]])))
    for pair in relative_orientations(xy[0][a], xy[1][b], typical)[:3]:
        rays = directions(np.broadcast_to(np.eye(3), (len(a), 3, 3)), xy[0][a])
        others = directions(np.broadcast_to(pair.rotation, (len(b), 3, 3)), xy[1][b])
        met = midpoints(rays, others, np.zeros(3), pair.position)
        # Points that do not agree yet may do so with the lens.
        before = (met[:, 2] > 0) & ((met - pair.position) @ pair.rotation[2] > 0)
        points = np.full((len(part.targets), 3), np.nan)
        points[first.points[a[before]]] = met[before]
        seen = np.isfinite(points[third.points, 0])
        poses = resections(points[third.points[seen]], xy[2][seen], sigma[2][seen])
        for pose in poses[:2]:
            start = NetworkState(
                calibrations,
                np.stack([np.eye(3), pair.rotation, pose.rotation]),
                np.stack([np.zeros(3), pair.position, pose.position]),
                points,
                np.isfinite(points[part.observations.point, 0]),
            )
            yield _Hypothesis(max(pair.scale / typical, pose.scale), start)


def _refined(
    part: Network, start: NetworkState, triple: tuple[int, int, int], unknown: list[int]
) -> Seed | None:
    """Return the seed after a robust adjustment, None where it fails."""
    views = (
        view if index in unknown else replace(view, fixed=True)
        for index, view in enumerate(part.cameras)
    )
    held = replace(part, cameras=tuple(views))
    try:
        start = refine(part, start, (), rounds=6)
        start, free = min(
            (with_lens(part, one, rounds=15) for one in _first(part, held, start)),
            key=lambda pair: _misfit(lengths_of(part, pair[0])),
        )
    except (ValueError, np.linalg.LinAlgError):
        return None
    focal = start.calibrations[unknown, 0]
    steps = np.array([focal_steps(part.cameras[one])[[0, -1]] for one in unknown]).reshape(-1, 2)
    if np.any(focal < 0.6 * steps[:, 0]) or np.any(focal > 2 * steps[:, 1]):
        return None
    lengths = lengths_of(part, start)
    spread = spread_of(lengths)
    if not np.isfinite(spread):
        return None
    cost = float(
        np.sum(np.minimum(np.nan_to_num(lengths[~np.isnan(lengths)]), BOUND * spread) ** 2)
    )
    angles = largest_angles(part, start)
    angle = float(np.median(angles[np.isfinite(angles)])) if np.isfinite(angles).any() else 0.0
    if angle < SMALLEST_ANGLE / 2:
        return None
    sigma = spread * focal_sigma(part, start, free) if unknown else 0.0
    return Seed(triple, start, spread, cost, angle, sigma)


def _first(part: Network, held: Network, start: NetworkState) -> Iterator[NetworkState]:
    """Yield values without the lens, and with it where they leave residuals unexplained.

    What is fitted without the lens may be far from where the lens explains them.
    """
    first = refine(held, start, ('f',), rounds=15)
    yield first
    if not all(camera.fixed for camera in part.cameras) and _unexplained(part, first):
        known = ~np.isnan(lengths_of(part, start))
        yield refine(part, replace(start, used=known), LENS[0], rounds=15)


def _unexplained(network: Network, start: NetworkState) -> bool:
    """Return whether a lens may explain what is left of residuals."""
    lengths = lengths_of(network, start)
    agree = np.mean(start.used[~np.isnan(lengths)])
    return bool(spread_of(lengths) >= UNEXPLAINED or agree <= MOST_AGREE)


def with_lens(
    network: Network, start: NetworkState, rounds: int
) -> tuple[NetworkState, tuple[str, ...]]:
    """Return the values with as much of the lenses as residuals ask for, and what was released.

    A lens that is not known makes residuals of many standard deviations, which would cost good
    observations, or photographs.
    """
    released: tuple[str, ...] = ('f',)
    if all(camera.fixed for camera in network.cameras):
        return start, released
    for free in LENS:
        if not _unexplained(network, start):
            break
        lengths = lengths_of(network, start)
        known = ~np.isnan(lengths)
        try:
            tried = refine(network, replace(start, used=known), free, rounds=rounds)
        except (ValueError, np.linalg.LinAlgError):
            break
        now = lengths_of(network, tried)
        certain = spread_of(now) * focal_sigma(network, tried, free) < WEAK
        if certain and _misfit(now[known]) < 0.9 * _misfit(lengths[known]):
            start, released = tried, free
    return start, released


def _misfit(lengths: FloatArray) -> float:
    """Return Cauchy's loss of residuals in standard deviations: what disagrees counts, too."""
    known = lengths[~np.isnan(lengths)]
    return float(np.sum(np.log1p((np.minimum(known, BEHIND) / BOUND) ** 2)))


def focal_sigma(network: Network, start: NetworkState, free: tuple[str, ...]) -> float:
    """Return the largest relative standard deviation of a free focal length, for unit weights."""
    mask = free_parameters(network, free)
    layout = image_points.lay_out(network, start, start.used, mask)
    focal = layout.columns[layout.free[:, 0], 0]
    if not len(focal):
        return 0.0 if len(layout.xy) else np.inf

    try:
        covariance = precision(layout, start, usual_lens(network, layout)).rest
    except np.linalg.LinAlgError:
        return np.inf
    variance = covariance[focal, focal]
    if np.any(variance <= 0) or not np.isfinite(variance).all():
        return np.inf
    return float(np.max(np.sqrt(variance) / start.calibrations[layout.free[:, 0], 0]))


def _whole(network: Network, seed: Seed, rows: IntArray) -> Seed:
    """Return a seed whose arrays are those of the whole network."""
    count = len(network.photographs)
    rotations, positions = np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan)
    used = np.zeros(len(network.observations.xy), dtype=bool)
    rotations[list(seed.photographs)] = seed.state.rotations
    positions[list(seed.photographs)] = seed.state.positions
    used[rows] = seed.state.used
    return replace(
        seed, state=replace(seed.state, rotations=rotations, positions=positions, used=used)
    )
