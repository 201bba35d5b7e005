"""The same observations adjusted by COLMAP: coordinates, time and standard deviations."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.orientation import normals
from ahf_ros.orientation.adjustment import adjust
from ahf_ros.orientation.camera import PARAMETERS
from ahf_ros.orientation.network import Network
from ahf_ros.orientation.similarity import similarity_between
from ahf_ros.orientation.solution import Start
from benchmarks.network_scenes import Field, approximate, simulate

SIZES = (8, 15, 30, 60)
OPENCV = (0, 0, 1, 2, 3, 4, 6, 7)  # COLMAP's fx, fy, cx, cy, k1, k2, p1, p2
RELEASED = ('f', 'cx', 'cy', 'k1', 'k2', 'p1', 'p2', 'affinity')
SIGMA = 0.05  # px; COLMAP weighs all image points alike


def table(seeds: Sequence[int]) -> list[str]:
    """Return the comparison as lines of Markdown."""
    import pycolmap

    lines = [
        f'pycolmap {pycolmap.__version__}',
        '',
        '| photographs | difference RMS, sigma | s here | s COLMAP | sigma here '
        '| sigma here, all else known | sigma COLMAP |',
        '|---|---|---|---|---|---|---|',
    ]
    for photographs in SIZES:
        random = np.random.default_rng([seeds[0], photographs])
        network, truth = simulate(Field(photographs, 40), random)
        count = len(network.observations.xy)
        equal = replace(
            network.observations, covariance=np.tile(SIGMA**2 * np.eye(2), (count, 1, 1))
        )
        network = replace(network, observations=equal)
        start = approximate(truth, random)
        begin = time.perf_counter()
        solution = adjust(network, start, release=RELEASED, test=False)
        seconds = time.perf_counter() - begin
        begin = time.perf_counter()
        theirs, covariances = colmap(pycolmap, network, start)
        their_seconds = time.perf_counter() - begin
        movement = similarity_between(theirs, solution.start.points)
        difference = movement.moved(theirs) - solution.start.points
        scale = solution.sigma0 if solution.scaled else 1.0
        sigma = np.sqrt(np.diag(solution.covariance_of_points)) / scale
        whole = np.sqrt((sigma.reshape(-1, 3) ** 2).mean(axis=1)).mean()
        theirs_mean = SIGMA * movement.scale * _mean(covariances)
        lines.append(
            f'| {photographs} | {np.sqrt(((difference.ravel() / sigma) ** 2).mean()):.1e} '
            f'| {seconds:.2f} | {their_seconds:.2f} | {whole:.3g} '
            f'| {_mean(conditioned(network, solution.start)):.3g} | {theirs_mean:.3g} |'
        )
    return lines


def conditioned(network: Network, start: Start) -> np.ndarray:
    """Return covariances (n, 3, 3) of points as if poses and cameras were known without error."""
    none = np.zeros((1, len(PARAMETERS)), dtype=bool)
    layout = normals.lay_out(network, start, start.used, none)
    by_point = normals.linearise(layout, start).by_point
    return np.linalg.inv(normals.Groups.by(layout.point).sum(normals.products(by_point, by_point)))


def _mean(covariances: np.ndarray) -> float:
    """Return the mean over points of the root mean square standard deviation of coordinates."""
    return float(np.sqrt(np.trace(covariances, axis1=1, axis2=2) / 3).mean())


def colmap(pycolmap: Any, network: Network, start: Start) -> tuple[np.ndarray, np.ndarray]:
    """Return COLMAP's points (n, 3) and their covariances (n, 3, 3) for unit weights."""
    model = pycolmap.Reconstruction()
    view, calibration = network.cameras[0], start.calibrations[0]
    parameters = calibration[list(OPENCV)]
    parameters[2:4] += 0.5  # (0.5, 0.5) is the centre of the first pixel
    camera = pycolmap.Camera(
        model='OPENCV', width=view.width, height=view.height, params=parameters, camera_id=1
    )
    model.add_camera_with_trivial_rig(camera)
    observations = network.observations
    elements: list[list[tuple[int, int]]] = [[] for _ in network.targets]
    for photograph, name in enumerate(network.photographs):
        rows = np.flatnonzero(observations.photograph == photograph)
        rotation = start.rotations[photograph]
        image = pycolmap.Image(
            name=name, keypoints=observations.xy[rows] + 0.5, camera_id=1, image_id=photograph + 1
        )
        pose = pycolmap.Rigid3d(
            pycolmap.Rotation3d(rotation), -rotation @ start.positions[photograph]
        )
        model.add_image_with_trivial_frame(image, pose)
        for place, row in enumerate(rows):
            elements[observations.point[row]].append((photograph + 1, place))
    ids = []
    for target, rays in enumerate(elements):
        track = pycolmap.Track()
        for image_id, place in rays:
            track.add_element(image_id, place)
        ids.append(model.add_point3D(start.points[target], track, np.zeros(3, dtype=np.uint8)))
    config = pycolmap.BundleAdjustmentConfig()
    for photograph in range(len(network.photographs)):
        config.add_image(photograph + 1)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_principal_point = True
    options.print_summary = False
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(options, config, model)
    adjuster.solve()
    options = pycolmap.BACovarianceOptions()
    options.params = pycolmap.BACovarianceOptionsParams.POINTS
    found = pycolmap.estimate_ba_covariance(options, model, adjuster)
    points = np.array([model.points3D[point].xyz for point in ids])
    return points, np.array([found.get_point_cov(point) for point in ids])
