"""The small hole in the middle of printed dots: a second centre, and how far both agree.

Metashape prints a white point in the middle of a dot. Where an image shows it, a blurred point is
fitted to the gray values there, which gives a centre that owes nothing to the edges of dot and
band. The table has the errors of both centres where the truth is known, the distance between them
in px and in what their covariances say (1 where these are right), and the error of their weighted
mean. Photographs have no truth to that accuracy. Seeds from 101 on are for tests.

    python -m benchmarks.pinholes [--seeds 101] [--output FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import create_detector
from ahf_ros.features.frame import affine_frames, circle_points, project
from ahf_ros.features.sampling import sample
from ahf_ros.interchange.image_files import read_image
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Target
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED, are_tests
from benchmarks.output import add_output, publish
from support import PHOTOS

HOLE = 0.05
"""Radius of the hole, dot radii."""

LIGHTS = (('normal', 0.3), ('stripe', 0.3), ('stripe', 0.12), ('lattice', 0.12))

_ROUNDS = 12
_MAXIMUM_STEP = 0.5  # of a centre in a round, px
_MAXIMUM_DISTANCE = 0.15  # of a hole from the centre of its target, radii of the dot
_CLEAR = 8.0  # height of a hole, in its standard deviation, for it to count as seen
_SHARE = 0.05  # the same, in the gray value beside the dot
_SOFTNESS = (0.3, 9.0)  # variance of the blur, px^2


@dataclass(frozen=True)
class Agreement:
    """Two centres of targets, by root mean squares a coordinate, px."""

    name: str
    targets: int
    seen: int
    own: float | None
    hole: float | None
    apart: float | None
    deviations: float | None
    combined: float | None


def dot_polarity(gray: np.ndarray, target: Target) -> int:
    """Return 1 where a dot is darker than what is about it, -1 where it is brighter."""
    ellipse = [[it] for it in (target.x, target.y, target.semi_major, target.semi_minor)]
    angles = 2 * np.pi * np.arange(24) / 24
    points = circle_points(angles, np.array([0.6, 1.4]))
    places = project(affine_frames(*ellipse, [target.angle]), points)[0]
    inside, outside = np.median(sample(gray.astype(np.float32), places), axis=0)
    return 1 if inside < outside else -1


def hole_centre(
    gray: np.ndarray, target: Target, polarity: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the centre of a hole, px, and its covariance, px^2; None where it is not seen.

    The image of the hole is a Gaussian with the variances of an elliptic disc and of a blur,
    fitted together with its height, the gray value of the dot and its place by least squares.

    Parameters
    ----------
    gray : ndarray of float, shape (height, width)
    target : Target
    polarity : int
        1 for a dark dot, whose hole is bright, -1 for a bright one.
    """
    reach = int(np.ceil(max(3.5, 2 * HOLE * target.semi_major + 2.5)))
    if target.semi_minor < reach + 2:
        return None
    column, row = round(target.x), round(target.y)
    window = gray[row - reach : row + reach + 1, column - reach : column + reach + 1]
    if min(column, row) < reach or window.shape != (2 * reach + 1, 2 * reach + 1):
        return None
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(float)
    shape = affine_frames([0.0], [0.0], [target.semi_major], [target.semi_minor], [target.angle])
    disc = shape[0, :2, :2] @ shape[0, :2, :2].T * HOLE**2 / 4
    centre, softness = np.array([target.x - column, target.y - row]), 0.8
    for _ in range(_ROUNDS):
        offset = np.stack([x - centre[0], y - centre[1]], axis=-1)
        inverse = np.linalg.inv(disc + softness * np.eye(2))
        away = offset @ inverse
        bump = np.exp(-0.5 * (away * offset).sum(axis=-1))
        height, ground = np.linalg.lstsq(
            np.stack([bump.ravel(), np.ones(bump.size)], axis=1), window.ravel(), rcond=None
        )[0]
        widened = 0.5 * bump * (away**2).sum(axis=-1)
        columns = [height * bump * away[..., 0], height * bump * away[..., 1], height * widened]
        design = np.stack([*columns, bump, np.ones_like(bump)], axis=-1).reshape(-1, 5)
        residual = (window - ground - height * bump).ravel()
        normal = design.T @ design + 1e-9 * np.eye(5)
        step = np.linalg.solve(normal, design.T @ residual)
        centre = centre + np.clip(step[:2], -_MAXIMUM_STEP, _MAXIMUM_STEP)
        softness = float(np.clip(softness + np.clip(step[2], -0.5, 0.5), *_SOFTNESS))
    noise = max(float(residual @ residual) / (residual.size - 5), 0.3**2)
    covariance = noise * np.linalg.inv(normal)
    moved = np.hypot(centre[0] + column - target.x, centre[1] + row - target.y)
    clear = polarity * height > max(_CLEAR * np.sqrt(covariance[3, 3]), _SHARE * gray.max())
    if not clear or moved > max(1.0, _MAXIMUM_DISTANCE * target.semi_minor):
        return None
    return centre + np.array([column, row]), covariance[:2, :2]


def agreement(
    name: str, images: Sequence[tuple[np.ndarray, Sequence[Target], dict[int, np.ndarray]]]
) -> Agreement:
    """Return how far both centres of the targets of some images agree.

    Parameters
    ----------
    name : str
    images : sequence of (ndarray, sequence of Target, dict)
        Image, what is identified in it, and the true centres by ID, none where unknown.
    """
    count, rows = 0, []
    for image, targets, truth in images:
        gray = image.astype(float)
        for target in targets:
            count += 1
            found = hole_centre(gray, target, dot_polarity(gray, target))
            if found is None:
                continue
            hole, covariance = found
            own, stated = np.array([target.x, target.y]), np.reshape(target.covariance, (2, 2))
            weights = np.linalg.inv(stated), np.linalg.inv(covariance)
            mean = np.linalg.solve(sum(weights), weights[0] @ own + weights[1] @ hole)
            apart = hole - own
            squares = apart @ np.linalg.solve(stated + covariance, apart) / 2
            true = truth.get(target.id)
            errors = (
                [np.nan] * 3
                if true is None
                else [((it - true) ** 2).mean() for it in (own, hole, mean)]
            )
            rows.append([*errors, (apart**2).mean(), squares])
    if not rows:
        return Agreement(name, count, 0, None, None, None, None, None)
    roots = np.sqrt(np.mean(rows, axis=0))
    own, hole, combined, apart, deviations = (
        None if np.isnan(root) else float(root) for root in roots
    )
    return Agreement(name, count, len(rows), own, hole, apart, deviations, combined)


def scenes(seeds: Sequence[int]) -> Iterator[tuple[str, list[SceneSettings]]]:
    """Yield the name of each row of rendered images, and their scenes."""
    for radius, targets in ((10.0, 54), (20.0, 54), (40.0, 30), (65.0, 15)):
        for light, ambient in LIGHTS:
            shown = [
                SceneSettings(
                    dot_radius=radius, targets=targets, light=light, ambient=ambient, seed=seed
                )
                for seed in seeds
            ]
            yield f'{radius:g} px, {light} {ambient:g}', shown
    for tilt in (45.0, 60.0):
        shown = [SceneSettings(tilt=tilt, focal_length=3.0, seed=seed) for seed in seeds]
        yield f'20 px, {tilt:g} deg', shown


def measure(seeds: Sequence[int]) -> Iterator[Agreement]:
    """Yield the rows of the table."""
    ring = create_detector('ring')
    for name, settings in track(list(scenes(seeds)), 'scenes', console=Console(stderr=True)):
        shown = [render(it) for it in settings]
        truth = [{it.id: np.array([it.x, it.y]) for it in one.targets} for one in shown]
        images = [(one.image, ring(one.image), of) for one, of in zip(shown, truth, strict=True)]
        yield agreement(name, images)
    aicon = create_detector('ring', family='aicon14')
    for name in ('panel/*.png', 'wall/*.jpg'):
        photographs = [read_image(path) for path in sorted(PHOTOS.glob(name))]
        if photographs:
            yield agreement(name, [(it, aicon(it), {}) for it in photographs])


def markdown(report: dict[str, Any]) -> str:
    """Return the report as a table."""
    facts = report['machine']
    kind = 'Test' if report['test'] else 'Development'
    lines = [
        f'{kind} seeds: {", ".join(map(str, report["seeds"]))}. {facts["processor"]}, Python '
        f'{facts["python"]}, numpy {facts["numpy"]}, OpenCV {facts["opencv"]}. RMS in px.',
        '',
        '| | targets | hole seen | own centre | hole | apart | in deviations | weighted mean |',
        '|---|---|---|---|---|---|---|---|',
    ]
    for row in report['rows']:
        numbers = [
            '' if row[name] is None else f'{row[name]:.{digits}f}'
            for name, digits in (
                ('own', 4),
                ('hole', 4),
                ('apart', 4),
                ('deviations', 2),
                ('combined', 4),
            )
        ]
        cells = [row['name'], row['targets'], row['seen'], *numbers]
        lines.append(f'| {" | ".join(map(str, cells))} |')
    return '\n'.join(lines)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    add_output(parser)
    options = parser.parse_args()
    report: dict[str, Any] = {
        'seeds': options.seeds,
        'test': are_tests(options.seeds),
        'machine': machine(),
        'rows': [asdict(row) for row in measure(options.seeds)],
    }
    publish(report, markdown(report), options.output)


if __name__ == '__main__':
    main()
