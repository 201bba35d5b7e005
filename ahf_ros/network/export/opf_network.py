"""Adjusted networks as a calibrated project in Pix4D's Open Photogrammetry Format (OPF) 1.0.

The frame of the camera has y up and z backwards; its axes in the world are
R_x(omega) R_y(phi) R_z(kappa). (0, 0) is the corner of the first pixel. T1 and T2 are OpenCV's p1
and p2, as Pix4D's own converter to COLMAP has them.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.network.export.adjusted import by_target, lens_of, oriented
from ahf_ros.network.export.opf import LOCAL_CRS, opf_item, opf_json, opf_uuid
from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import Solution
from ahf_ros.network.units import METRES

_CORNER = 0.5  # coordinate of the centre of the first pixel
_AXES = np.diag([1.0, -1.0, -1.0])  # of OPF's frame of the camera in ours
_SHORT = {'mm': 'millimetre', 'cm': 'centimetre', 'm': 'metre'}
_NOBODY_KNOWS = '1970-01-01T00:00:00Z'  # when a photograph was taken
_PIXEL = 1.0  # um, which is required and says nothing where focal lengths are in px


def opf_network_files(solution: Solution) -> dict[str, bytes]:
    """Return a project with calibrated cameras and targets, and what these were measured from."""
    network = solution.network
    points = [
        {'id': network.targets[target], 'coordinates': solution.state.points[target].tolist()}
        for target in by_target(solution)
    ]
    files = {
        'camera_list': {'cameras': _camera_list(solution)},
        'input_cameras': _input_cameras(solution),
        'scene_reference_frame': _frame(network.unit),
        'input_control_points': {'gcps': [], 'mtps': _marks(solution)},
        'calibrated_cameras': _calibrated(solution),
        'calibrated_control_points': {'points': points},
    }
    items = [
        opf_item('camera_list'),
        opf_item('input_cameras', sources=('camera_list',)),
        opf_item('scene_reference_frame'),
        opf_item('input_control_points', sources=('camera_list',)),
        opf_item(
            'calibration',
            sources=('input_cameras', 'scene_reference_frame', 'input_control_points'),
            files=('calibrated_cameras', 'calibrated_control_points'),
        ),
    ]
    project = opf_json(
        'project',
        id=opf_uuid('project'),
        name='ahf',
        description='Coded targets, oriented by ahf_ros',
        items=items,
    )
    return {
        'project.opf': project,
        **{
            f'{kind}.json': opf_json(kind.replace('_', '-'), **content)
            for kind, content in files.items()
        },
    }


def _camera_list(solution: Solution) -> list[dict[str, Any]]:
    return [
        {'id': number + 1, 'uri': Path(solution.network.photographs[number]).absolute().as_uri()}
        for number in oriented(solution)
    ]


def _sensors(solution: Solution) -> list[int]:
    return np.flatnonzero(solution.calibrated).tolist()


def _internals(solution: Solution, camera: int) -> dict[str, Any]:
    lens = lens_of(solution, camera, square=True)
    return {
        'type': 'perspective',
        'principal_point_px': [lens.cx + _CORNER, lens.cy + _CORNER],
        'focal_length_px': lens.fx,
        'radial_distortion': [lens.k1, lens.k2, lens.k3],
        'tangential_distortion': [lens.p1, lens.p2],
    }


def _input_cameras(solution: Solution) -> dict[str, Any]:
    network = solution.network
    sensors = [
        {
            'id': camera + 1,
            'name': network.cameras[camera].name,
            'bands': [{'weight': 1.0}],
            'image_size_px': [network.cameras[camera].width, network.cameras[camera].height],
            'pixel_size_um': _PIXEL,
            'internals': _internals(solution, camera),
            'shutter_type': 'global',
        }
        for camera in _sensors(solution)
    ]
    captures = [
        {
            'id': number + 1,
            'rig_model_source': 'not_applicable',
            'cameras': [
                {
                    'id': number + 1,
                    'sensor_id': int(network.camera_of[number]) + 1,
                    'model_source': 'user',
                    'pixel_type': 'uint8',
                    'pixel_range': {'min': 0, 'max': 255},
                }
            ],
            'reference_camera_id': number + 1,
            'time': _NOBODY_KNOWS,
        }
        for number in oriented(solution)
    ]
    return {'sensors': sensors, 'captures': captures}


def _frame(unit: str) -> dict[str, Any]:
    metres = METRES.get(unit, 1.0)
    name = _SHORT.get(unit, unit or 'metre')
    definition = LOCAL_CRS.replace('"metre",1.0', f'"{name}",{metres!r}')
    transform = {'scale': [1.0, 1.0, 1.0], 'shift': [0.0, 0.0, 0.0], 'swap_xy': False}
    return {'crs': {'definition': definition}, 'base_to_canonical': transform}


def _marks(solution: Solution) -> list[dict[str, Any]]:
    """Return targets as manual tie points; the accuracy of a mark is its standard deviation."""
    seen = solution.network.observations
    sigmas = {
        (int(photograph), int(point)): math.sqrt(np.trace(covariance) / 2)
        for photograph, point, covariance in zip(
            seen.photograph, seen.point, seen.covariance, strict=True
        )
    }
    return [
        {
            'id': solution.network.targets[target],
            'is_checkpoint': False,
            'marks': [
                {
                    'camera_id': it.photograph + 1,
                    'position_px': (it.xy + _CORNER).tolist(),
                    'accuracy': sigmas[it.photograph, target],
                }
                for it in track
            ],
        }
        for target, track in by_target(solution).items()
    ]


def _calibrated(solution: Solution) -> dict[str, Any]:
    start = solution.state
    return {
        'sensors': [
            {'id': camera + 1, 'internals': _internals(solution, camera)}
            for camera in _sensors(solution)
        ],
        'cameras': [
            {
                'id': number + 1,
                'sensor_id': int(solution.network.camera_of[number]) + 1,
                'orientation_deg': omega_phi_kappa(start.rotations[number].T @ _AXES),
                'position': start.positions[number].tolist(),
            }
            for number in oriented(solution)
        ],
    }


def omega_phi_kappa(rotation: FloatArray) -> list[float]:
    """Return the angles of R_x(omega) R_y(phi) R_z(kappa), degrees.

    Examples
    --------
    >>> omega_phi_kappa(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))
    [90.0, 0.0, 0.0]
    """
    phi = math.asin(min(max(float(rotation[0, 2]), -1.0), 1.0))
    omega = math.atan2(-rotation[1, 2], rotation[2, 2])
    kappa = math.atan2(-rotation[0, 1], rotation[0, 0])
    return [math.degrees(angle) + 0.0 for angle in (omega, phi, kappa)]
