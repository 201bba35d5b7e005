"""The calibration sheet `camcal` beside the solution of the Damped Bundle Adjustment Toolbox.

Its 21 photographs of 100 points, 4 of them fixed, come with DBAT's parameters and standard
deviations, in the model of Brown backward, with affinity and without shear. They start here from
DBAT's stations, rounded, and a focal length of 1.2 image widths.
"""

import os
import re
from pathlib import Path

import numpy as np

from ahf_ros.network.adjustment import adjust
from ahf_ros.network.camera import PARAMETERS, pinhole, undistort
from ahf_ros.network.network import CameraView, ControlPoint, Network, Observations
from ahf_ros.network.refinement import refine
from ahf_ros.network.solution import NetworkState, Solution

WIDTH, HEIGHT = 2272, 1704
PIXEL = 5.43764 / HEIGHT  # mm, its height
RELEASED = ('f', 'cx', 'cy', 'k1', 'k2', 'k3', 'p1', 'p2', 'affinity')


def folder() -> Path | None:
    """Return the folder of the data, or None where `AHF_NETWORKS` does not name it."""
    root = os.environ.get('AHF_NETWORKS')
    path = Path(root or '.') / 'camcal'
    return path if root and path.exists() else None


def network(path: Path) -> Network:
    """Return the network; DBAT has (0.5, 0.5) at the centre of the first pixel."""
    rows = np.loadtxt(path / 'measurements_markpts.txt', delimiter=',')
    lines = (path / 'reference_camcal-fixed.txt').read_text(encoding='utf-8').splitlines()
    fields = [line.split(',') for line in lines if line[:1].isdigit()]
    control = tuple(
        ControlPoint(row[0], np.array(row[2:5], dtype=float), np.zeros((3, 3))) for row in fields
    )
    images, photograph = np.unique(rows[:, 0].astype(int), return_inverse=True)
    targets, point = np.unique(rows[:, 1].astype(int), return_inverse=True)
    return Network(
        tuple(str(image) for image in images),
        np.zeros(len(images), dtype=int),
        (CameraView('C4040Z', WIDTH, HEIGHT),),
        tuple(str(target) for target in targets),
        Observations(
            photograph, point, rows[:, 2:4] - 0.5, rows[:, 4, None, None] ** 2 * np.eye(2)
        ),
        control=control,
        unit='m',
    )


def start(path: Path, sheet: Network) -> NetworkState:
    """Return DBAT's stations to 1 cm and 1 degree, and points in the plane of the sheet."""
    lines = (path / 'result_camera_stations.txt').read_text(encoding='utf-8').splitlines()
    values = np.array([line.split(',')[2:8] for line in lines if line[:1] != '#'], dtype=float)
    positions = values[:, :3].round(2)
    rotations = np.array([_rotation(np.deg2rad(np.rad2deg(row[3:]).round())) for row in values])
    calibration = pinhole(1.2 * WIDTH, WIDTH, HEIGHT)
    observations = sheet.observations
    rays = np.column_stack(
        [undistort(calibration, observations.xy), np.ones(len(observations.xy))]
    )
    rays = np.einsum('mij,mi->mj', rotations[observations.photograph], rays)
    origin = positions[observations.photograph]
    crossings = origin - rays * (origin[:, 2] / rays[:, 2])[:, None]
    points = np.array(
        [np.median(crossings[observations.point == k], axis=0) for k in range(len(sheet.targets))]
    )
    return NetworkState(
        calibration[None], rotations, positions, points, np.ones(len(observations.xy), dtype=bool)
    )


def solve(path: Path) -> Solution:
    """Return the adjustment in DBAT's datum and model."""
    sheet = network(path)
    first = refine(sheet, start(path, sheet), ('f', 'k1'))
    every = np.ones(len(first.used), dtype=bool)
    first = NetworkState(first.calibrations, first.rotations, first.positions, first.points, every)
    return adjust(sheet, first, release=RELEASED, test=False, backward=True)


def in_dbat_units(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Return DBAT's nine parameters and their standard deviations, in mm."""
    place = {name: index for index, name in enumerate(PARAMETERS)}

    def converted(calibration: np.ndarray) -> np.ndarray:
        value = {name: calibration[index] for name, index in place.items()}
        focal = value['f'] * PIXEL
        aspect = 1 / (1 + value['affinity']) - 1
        return np.array(
            [
                focal,
                (value['cx'] + 0.5) * PIXEL,  # DBAT scales x after it takes off px
                (value['cy'] + 0.5) * PIXEL,
                aspect,
                value['k1'] / focal**2,
                value['k2'] / focal**4,
                value['k3'] / focal**6,
                value['p2'] / focal,
                -value['p1'] / focal,
            ]
        )

    calibration = solution.state.calibrations[0]
    steps = 1e-6 * np.maximum(np.abs(calibration), 1)
    jacobian = np.stack(
        [
            (converted(calibration + step) - converted(calibration - step)) / (2 * step.sum())
            for step in np.diag(steps)
        ],
        axis=1,
    )
    covariance = jacobian @ solution.camera_covariances[0] @ jacobian.T
    return converted(calibration), np.sqrt(np.diag(covariance))


def dbat(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return DBAT's parameters, and their standard deviations to three digits."""
    camera = (path / 'result_c4040z.xml').read_text(encoding='utf-8')
    report = (path / 'result_report.txt').read_text(encoding='utf-8')
    value = {
        name: np.array(text.split(','), dtype=float)
        for name, text in re.findall(r'<(cc|pp|aspect|K|P)>([^<]*)</', camera)
    }
    aspect = 1 / value['aspect'] - 1
    values = [value['cc'], value['pp'], aspect, value['K'], value['P']]
    names = (
        'Camera Constant', 'px -', 'py -', 'as -', 'K1 -', 'K2 -', 'K3 -', 'P1 -', 'P2 -',
    )  # fmt: skip
    deviations = [
        float(report.split(name, 1)[1].split('Deviation:', 1)[1].split()[0]) for name in names
    ]
    return np.concatenate(values), np.array(deviations)


def _rotation(angles: np.ndarray) -> np.ndarray:
    """Return the rotation to a frame with y down and z forward of omega, phi and kappa in rad."""
    (so, sp, sk), (co, cp, ck) = np.sin(angles), np.cos(angles)
    about_x = np.array([[1, 0, 0], [0, co, so], [0, -so, co]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    about_z = np.array([[ck, sk, 0], [-sk, ck, 0], [0, 0, 1]])
    return np.diag([1.0, -1.0, -1.0]) @ about_z @ about_y @ about_x
