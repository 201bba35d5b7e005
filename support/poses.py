"""Single images of targets whose poses are known."""

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.network.camera import project, rotation_matrices
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.transform import Transform

SIZE = 2464, 2056
CAMERA = np.array([2400.0, 1240.0, 1020.0, -0.1, 0.08, -0.02, 3e-4, -2e-4, 0.0, 0.0])


@dataclass(frozen=True)
class View:
    """One image of targets, its true pose, and the coordinates as somebody measured them."""

    targets: tuple[Target, ...]
    points: MeasuredPoints
    true: Transform
    wrong: str = ''  # name of the target with another's ID


def view(
    width: float, depth: float, random: np.random.Generator, sigma_points: float = 2e-5
) -> View:
    """Return an image of 20 to 50 targets in a field of this width and half the depth, m.

    Centres have covariances of their own; the coordinates have a common one.
    """
    count = int(random.integers(20, 51))
    xyz = random.uniform(-1, 1, (count, 3)) * (width / 2, width / 2, depth)
    turn = rotation_matrices(random.normal(size=(1, 3)))[0]  # of the field in its frame
    shift = random.uniform(-2, 2, 3)
    direction = random.normal(size=3) * (0.6, 0.6, 0)
    direction[2] = -1
    distance = random.uniform(1.5, 3.0)
    forward = -direction / np.linalg.norm(direction)
    aside = np.cross(forward, random.normal(size=3))
    aside /= np.linalg.norm(aside)
    rotation = np.array([aside, np.cross(forward, aside), forward])
    position = -distance * forward + random.uniform(-0.1, 0.1, 3)
    exact = project(CAMERA, rotation, position, xyz)
    mixing = random.normal(size=(count, 2, 2)) * random.uniform(0.02, 0.2, (count, 1, 1))
    covariances = mixing @ mixing.transpose(0, 2, 1) + 1e-4 * np.eye(2)
    noise = np.linalg.cholesky(covariances) @ random.normal(size=(count, 2, 1))
    seen = exact + noise[:, :, 0]
    root = sigma_points * random.normal(size=(3 * count, 3 * count)) / np.sqrt(3 * count)
    root += sigma_points * np.eye(3 * count)
    measured = (xyz @ turn.T + shift).ravel() + root @ random.normal(size=3 * count)
    names = tuple(str(number) for number in range(1, count + 1))
    points = MeasuredPoints(names, measured.reshape(-1, 3), root @ root.T, unit='m')
    targets = tuple(
        Target(number + 1, 0, x, y, 8.0, 8.0, covariance=tuple(covariances[number].ravel()))
        for number, (x, y) in enumerate(seen.tolist())
    )
    true = Transform(turn @ rotation.T, turn @ position + shift)
    return View(targets, points, true)


def with_wrong_id(of: View, random: np.random.Generator) -> View:
    """Return the image with one target that is read as another one, which is not seen."""
    lost, wrong = random.choice(len(of.targets), 2, replace=False)
    renamed = replace(of.targets[wrong], id=of.targets[lost].id)
    targets = tuple(
        renamed if index == wrong else it for index, it in enumerate(of.targets) if index != lost
    )
    return replace(of, targets=targets, wrong=str(renamed.id))


def error(found: Transform, true: Transform) -> FloatArray:
    """Return shift and turn (6,) from a pose to the true one, about the axes of the frame.

    Both are those of the even screw motion from one to the other (Barfoot 2017, 7.1.3): the
    position of a camera that turns about far targets moves on an arc, whose height would else be
    many standard deviations.
    """
    turned = true.rotation @ found.rotation.T
    turn = Transform(turned).turn
    angle = float(np.linalg.norm(turn))
    cross = np.cross(np.eye(3), turn)
    along = np.eye(3) + (0.5 - angle**2 / 24) * cross + (1 / 6 - angle**2 / 120) * cross @ cross
    shift = np.linalg.solve(along, true.translation - turned @ found.translation)
    return np.concatenate((shift + np.cross(turn, found.translation), turn))


def normalised_square(found: Transform, true: Transform) -> float:
    """Return the squared error in the metric of the covariance, 6 in the mean."""
    gap = error(found, true)
    return float(gap @ np.linalg.solve(found.covariance, gap))
