"""Where cameras are mounted on a robot's hand, beside its base, or on each other [1]_, [2]_.

A robot says where its hand is, and a network where its cameras are: with B the pose of the hand in
the frame of the base, C that of the camera in the frame of the targets, X of the camera on the
hand and Z of the targets in the frame of the base, B X = Z C. With a fixed camera and targets on
the hand, X is the pose of the targets on the hand, Z that of the camera in the frame of the base,
and C is inverted. Without a robot, B is the pose of a reference camera and Z is 1. All are one
adjustment of the poses of network and robot, with their covariances. A network without scale gets
that of the robot.

The residual of a station is the step from Z C to B X along the axes of the base: its errors are
those of `transform`.

References
----------
.. [1] Tsai & Lenz, IEEE Trans. Robotics and Automation 1989, 5, 345; Park & Martin, ibid. 1994,
   10, 717: rotations first.
.. [2] Strobl & Hirzinger, Optimal hand-eye calibration, IROS 2006: a metric of all errors.
"""

from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.network.network import FloatArray
from ahf_ros.network.testing import special
from ahf_ros.network.transform import Transform, lever, turned_errors, twice

FEWEST_STATIONS = 3

_SMALLEST_TURN = np.radians(5.0)  # of the hand about a second axis
_CONVERGED = 1e-9  # step in standard deviations
_ROUNDS = 50
_ERROR = 1e-3  # probability that a right station is taken for a wrong one, over all stations


class Contradiction(ValueError):
    """Poses of robot and photographs that no mounting explains."""


@dataclass(frozen=True)
class Station:
    """A pose of the robot and what one camera saw there, with their covariances.

    Images with the same `place` were taken at one pose of the robot, which they share.
    """

    name: str
    place: Hashable
    camera: str
    robot: Transform
    seen: Transform
    """The pose of the camera in the frame of the targets, or of the targets in the camera's."""


@dataclass(frozen=True)
class Mounted:
    """What a mounting is: poses by camera, and what did not agree.

    `mounts` are the X, `fields` the Z of the module; one of them has a single pose, named ''.
    """

    mounts: dict[str, Transform]
    fields: dict[str, Transform]
    scale: float
    """Unit of the robot's poses over that of the network."""
    scale_sigma: float
    sigma0: float
    redundancy: int
    residuals: dict[str, FloatArray]
    """(6,) by image: metres (or the robot's unit) and rad, in the frame of the camera or field."""
    rejected: dict[str, float]
    """Images that contradict all others, with their normalised residual."""


def mounted(
    stations: Sequence[Station],
    *,
    targets_on_hand: bool = False,
    scale: float | None = None,
    field: Transform | None = None,
) -> Mounted:
    """Return where cameras, or the targets, are on the hand.

    With `targets_on_hand`, stations have seen the targets in the camera's frame, and each camera
    has a fixed pose of its own in the frame of the base. `scale` is that of lengths in the network
    to the robot's, None where the robot gives it; `field` is Z where it is known.

    A station that contradicts all others is left out and named, one by one. A ValueError says what
    is missing where the mounting is not determined.
    """
    kept = list(stations)
    rejected: dict[str, float] = {}
    while True:
        _check(kept, field)
        model = _Model(kept, targets_on_hand, scale, field)
        place, size, bound = model.worst()
        if size <= bound:
            return model.result(rejected)
        rejected |= {it.name: size for it in kept if it.place == place}
        kept = [it for it in kept if it.place != place]


def _check(stations: Sequence[Station], field: Transform | None) -> None:
    if field is not None:
        if not stations:
            raise ValueError('no two cameras took photographs at one station')
        return
    places = {it.place for it in stations}
    if len(places) < FEWEST_STATIONS:
        raise ValueError(
            f'{len(places)} poses of the robot agree with oriented photographs, accepted are '
            f'{FEWEST_STATIONS} or more'
        )
    turns = _turns(stations)
    second = float(np.linalg.svd(turns, compute_uv=False)[1] / np.sqrt(len(turns)))
    if second < _SMALLEST_TURN:
        raise ValueError(
            'the hand turned about one axis only: about others by '
            f'{np.degrees(second):.1f} degrees, which does not determine where it holds what it '
            'holds; accepted are turns about two axes, better by 30 degrees or more'
        )


def _turns(stations: Sequence[Station]) -> FloatArray:
    """Return rotation vectors (n, 3) of the hand from its mean rotation."""
    mean = nearest_rotation(sum((it.robot.rotation for it in stations), np.zeros((3, 3))))
    return np.stack([Transform(mean.T @ it.robot.rotation).turn for it in stations])


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) nearest to a matrix in the sum of squared differences."""
    left, _, right = np.linalg.svd(matrix)
    return (left * [1, 1, np.linalg.det(left @ right)]) @ right


class _Model:
    """The adjustment of some stations, converged."""

    def __init__(
        self,
        stations: Sequence[Station],
        targets_on_hand: bool,
        scale: float | None,
        field: Transform | None,
    ) -> None:
        self.stations = stations
        cameras = sorted({it.camera for it in stations})
        self.mount_names = [''] if targets_on_hand else cameras
        self.field_names = cameras if targets_on_hand else ['']
        self.targets_on_hand = targets_on_hand
        self.free_field = field is None
        self.free_scale = scale is None
        places: dict[Hashable, list[int]] = defaultdict(list)
        for index, station in enumerate(stations):
            places[station.place].append(index)
        self.places = list(places.values())
        self.mounts, self.fields, self.scale = self._start(scale, field)
        self._adjust()

    @property
    def unknowns(self) -> int:
        """Number of unknowns: six of each pose, and the scale."""
        poses = len(self.mount_names) + self.free_field * len(self.field_names)
        return 6 * poses + self.free_scale

    def _start(
        self, scale: float | None, field: Transform | None
    ) -> tuple[dict[str, Transform], dict[str, Transform], float]:
        """Return approximate poses: rotations from all pairs, then what is linear."""
        mounts: dict[str, Transform] = {}
        fields: dict[str, Transform] = {'': field} if field else {}
        if field is not None:
            for station in self.stations:
                mounts[station.camera] = station.robot.inverse @ field @ station.seen
            return mounts, fields, 1.0 if scale is None else scale
        sizes = []
        for camera in sorted({it.camera for it in self.stations}):
            mine = [it for it in self.stations if it.camera == camera]
            if len({it.place for it in mine}) < FEWEST_STATIONS:
                raise ValueError(
                    f'{camera} took photographs at fewer than {FEWEST_STATIONS} stations'
                )
            _check(mine, None)
            mount, base, size = _approximate(mine, scale)
            if self.targets_on_hand:
                mounts.setdefault('', mount)
                fields[camera] = base
            else:
                mounts[camera] = mount
                fields.setdefault('', base)
            sizes.append(size)
        return mounts, fields, float(np.median(sizes))

    def _names(self, station: Station) -> tuple[str, str]:
        return ('', station.camera) if self.targets_on_hand else (station.camera, '')

    def _equations(self) -> tuple[list[FloatArray], list[FloatArray], list[FloatArray]]:
        """Return residuals, rows and covariances of the stations at each place."""
        residuals, rows, covariances = [], [], []
        mount_column = {it: 6 * number for number, it in enumerate(self.mount_names)}
        first = 6 * len(self.mount_names)
        field_column = {it: first + 6 * number for number, it in enumerate(self.field_names)}
        for members in self.places:
            gaps = np.zeros(6 * len(members))
            design = np.zeros((6 * len(members), self.unknowns))
            of_robot = np.zeros((6 * len(members), 6))
            noise = np.zeros((6 * len(members), 6 * len(members)))
            for number, index in enumerate(members):
                station = self.stations[index]
                mount_name, field_name = self._names(station)
                mount, base = self.mounts[mount_name], self.fields[field_name]
                robot, seen = station.robot, station.seen.scaled(self.scale)
                part = slice(6 * number, 6 * number + 6)
                gaps[part] = (robot @ mount).step_from(base @ seen)
                column = mount_column[mount_name]
                design[part, column : column + 6] = twice(robot.rotation)
                ray = base.rotation @ station.seen.translation
                if self.free_field:
                    column = field_column[field_name]
                    design[part, column : column + 6] = -lever(self.scale * ray)
                if self.free_scale:
                    design[part, -1] = np.concatenate([-ray, np.zeros(3)])
                of_robot[part] = lever(robot.rotation @ mount.translation)
                noise[part, part] = turned_errors(base.rotation, seen.covariance)
            common = self.stations[members[0]].robot.covariance
            residuals.append(gaps)
            rows.append(design)
            covariances.append(noise + of_robot @ common @ of_robot.T)
        return residuals, rows, covariances

    def _adjust(self) -> None:
        for _ in range(_ROUNDS):
            residuals, rows, covariances = self._equations()
            normal = np.zeros((self.unknowns, self.unknowns))
            right = np.zeros(self.unknowns)
            for gaps, design, covariance in zip(residuals, rows, covariances, strict=True):
                weighted = np.linalg.solve(covariance, design)
                normal += weighted.T @ design
                right -= weighted.T @ gaps
            size = 1 / np.sqrt(np.diag(normal))
            covariance = size[:, None] * np.linalg.inv(size[:, None] * normal * size) * size
            step = covariance @ right
            for number, name in enumerate(self.mount_names):
                self.mounts[name] = self.mounts[name].stepped(step[6 * number : 6 * number + 6])
            if self.free_field:
                for number, name in enumerate(self.field_names, len(self.mount_names)):
                    part = step[6 * number : 6 * number + 6]
                    self.fields[name] = self.fields[name].stepped(part)
            if self.free_scale:
                self.scale += step[-1]
            if step @ right < _CONVERGED:
                break
        else:
            raise Contradiction('the poses of robot and photographs do not fit together')
        self.residuals, self.rows, self.covariances = self._equations()
        self.covariance = covariance

    @property
    def cost(self) -> float:
        """Sum of weighted squares of the residuals."""
        pairs = zip(self.residuals, self.covariances, strict=True)
        return float(sum(gaps @ np.linalg.solve(noise, gaps) for gaps, noise in pairs))

    @property
    def redundancy(self) -> int:
        """Number of observations beyond those that determine the unknowns."""
        return 6 * len(self.stations) - self.unknowns

    def worst(self) -> tuple[Hashable, float, float]:
        """Return the place that agrees least with all others, its size and the largest right one.

        The size is the root of v' Q_v^-1 v of its residuals over their number (Baarda 1968),
        relative to the variance that the others have where this is above 1: the sigmas of a
        robot are a guess.
        """
        worst: tuple[Hashable, float, float] = None, 0.0, np.inf
        cost = self.cost
        for members, gaps, design, noise in zip(
            self.places, self.residuals, self.rows, self.covariances, strict=True
        ):
            degrees, rest = 6 * len(members), self.redundancy - 6 * len(members)
            if rest <= 0:
                continue
            of_residual = noise - design @ self.covariance @ design.T
            square = float(gaps @ np.linalg.pinv(of_residual, rcond=1e-9, hermitian=True) @ gaps)
            others = max((cost - square) / rest, 1.0)
            size = float(np.sqrt(square / degrees / others))
            bound = special().fdtri(degrees, rest, 1 - _ERROR / len(self.places))
            if size / np.sqrt(bound) > worst[1] / worst[2]:
                worst = self.stations[members[0]].place, size, float(np.sqrt(bound))
        return worst

    def result(self, rejected: dict[str, float]) -> Mounted:
        """Return the poses with their covariances about the axes of their parents."""
        sigma0 = float(np.sqrt(self.cost / self.redundancy)) if self.redundancy else 1.0
        scaled = sigma0**2 * self.covariance

        def poses(
            found: dict[str, Transform], names: list[str], first: int
        ) -> dict[str, Transform]:
            parts = [slice(6 * it, 6 * it + 6) for it in range(first, first + len(names))]
            return {
                name: replace(found[name], covariance=scaled[part, part])
                for name, part in zip(names, parts, strict=True)
            }

        residuals = {}
        for members, gaps in zip(self.places, self.residuals, strict=True):
            for number, index in enumerate(members):
                station = self.stations[index]
                base = self.fields[self._names(station)[1]]
                turn = twice((base @ station.seen).rotation)
                residuals[station.name] = gaps[6 * number : 6 * number + 6] @ turn
        return Mounted(
            mounts=poses(self.mounts, self.mount_names, 0),
            fields=poses(self.fields, self.field_names, len(self.mount_names))
            if self.free_field
            else self.fields,
            scale=float(self.scale),
            scale_sigma=float(np.sqrt(scaled[-1, -1])) if self.free_scale else 0.0,
            sigma0=sigma0,
            redundancy=self.redundancy,
            residuals=residuals,
            rejected=rejected,
        )


def _approximate(
    stations: Sequence[Station], scale: float | None
) -> tuple[Transform, Transform, float]:
    """Return X, Z and the scale of one camera, by a linear solution.

    Turns between stations of the hand are those of the camera, seen from the hand [1]_: their
    axes are turned into each other. Then R_B t_X + t_B = R_Z s t_C + t_Z is linear.
    """
    pairs = [(i, j) for i in range(len(stations)) for j in range(i)]

    def axes(rotations: list[FloatArray]) -> FloatArray:
        return np.stack([Transform(rotations[i].T @ rotations[j]).turn for i, j in pairs])

    of_hand = axes([it.robot.rotation for it in stations])
    of_seen = axes([it.seen.rotation for it in stations])
    on_hand = nearest_rotation(of_hand.T @ of_seen)
    turns = (it.robot.rotation @ on_hand @ it.seen.rotation.T for it in stations)
    of_field = nearest_rotation(sum(turns, np.zeros((3, 3))))
    rows, gaps = [], []
    for station in stations:
        ray = of_field @ station.seen.translation
        rows.append(np.column_stack([station.robot.rotation, -np.eye(3), -ray]))
        gaps.append(-station.robot.translation)
    design, right_side = np.concatenate(rows), np.concatenate(gaps)
    if scale is not None:
        right_side = right_side - scale * design[:, -1]
        design = design[:, :-1]
    solved = np.linalg.lstsq(design, right_side, rcond=None)[0]
    size = float(solved[6]) if scale is None else scale
    return Transform(on_hand, solved[:3]), Transform(of_field, solved[3:6]), size
