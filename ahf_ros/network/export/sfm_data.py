"""Adjusted networks as scenes of AliceVision (Meshroom) and OpenMVG, both in JSON.

Both have our frame of the camera, and Brown's and the fisheye distortion as OpenCV has them.
(0, 0) is the centre of the first pixel, as in their features and undistorted images. AliceVision
keeps a rotation column after column, its principal point from the middle of the image, and its
focal length in mm of a sensor; OpenMVG has one focal length, and its file is what the library
cereal writes.
"""

import json
from collections.abc import Iterator
from itertools import count
from pathlib import PurePath
from typing import Any

import numpy as np

from ahf_ros.network.export.adjusted import Lens, by_target, file_name, lens_of, oriented
from ahf_ros.network.solution import Solution

_SENSOR = 36.0, 24.0  # mm, which AliceVision takes where nothing says the size
_NEW = 0x80000000  # cereal: an identifier that appears for the first time
_PLAIN = 0x40000000  # cereal: a pointer to the type itself


def alicevision_files(solution: Solution) -> dict[str, bytes]:
    """Return the scene, whose views, poses and landmarks are our numbers from 1 on.

    The IDs of targets are in `landmark_labels`, which AliceVision leaves alone.
    """
    network, start = solution.network, solution.state
    views, poses = [], []
    for number in oriented(solution):
        view = network.cameras[network.camera_of[number]]
        views.append(
            {
                'viewId': number + 1,
                'poseId': number + 1,
                'intrinsicId': network.camera_of[number] + 1,
                'path': network.photographs[number],
                'width': view.width,
                'height': view.height,
                'metadata': '',
            }
        )
        transform = {
            'rotation': start.rotations[number].ravel(order='F'),
            'center': start.positions[number],
        }
        pose = {'transform': transform, 'locked': 1, 'valid': 1}
        poses.append({'poseId': number + 1, 'pose': pose})
    structure = [
        {
            'landmarkId': target + 1,
            'descType': 'unknown',
            'color': [255, 255, 255],
            'X': start.points[target],
            'observations': [
                {'observationId': it.photograph + 1, 'featureId': target, 'x': it.xy, 'scale': 0}
                for it in seen
            ],
        }
        for target, seen in by_target(solution).items()
    ]
    labels = {target + 1: network.targets[target] for target in by_target(solution)}
    scene = {
        'version': [1, 2, 6],
        'views': views,
        'intrinsics': [
            _alicevision_lens(solution, camera)
            for camera in np.flatnonzero(solution.calibrated).tolist()
        ],
        'poses': poses,
        'structure': structure,
        'landmark_labels': labels,
    }
    return {'cameras.sfm': _json(_as_texts(scene))}


def _alicevision_lens(solution: Solution, camera: int) -> dict[str, Any]:
    view, lens = solution.network.cameras[camera], lens_of(solution, camera)
    focal = lens.fx * _SENSOR[0] / view.width
    return {
        'intrinsicId': camera + 1,
        'width': view.width,
        'height': view.height,
        'sensorWidth': _SENSOR[0],
        'sensorHeight': _SENSOR[1],
        'serialNumber': view.name,
        'type': 'fisheye4' if view.equidistant else 'brown',
        'initializationMode': 'calibrated',
        'initialFocalLength': focal,
        'focalLength': focal,
        'pixelRatio': lens.fy / lens.fx,
        'pixelRatioLocked': 'true',
        'principalPoint': [lens.cx - view.width / 2, lens.cy - view.height / 2],
        'distortionInitializationMode': 'calibrated',
        'distortionParams': _distortion(lens, view.equidistant),
        'undistortionOffset': [0, 0],
        'undistortionParams': '',
        'locked': 'true',
    }


def _distortion(lens: Lens, equidistant: bool) -> list[float]:
    """Return the coefficients of a lens as both programs order them."""
    beside = [lens.k4] if equidistant else [lens.p1, lens.p2]
    return [lens.k1, lens.k2, lens.k3, *beside]


def _as_texts(value: Any) -> Any:
    """Return JSON whose numbers are texts, as boost's property trees write them."""
    if isinstance(value, dict):
        return {str(name): _as_texts(it) for name, it in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_as_texts(it) for it in value]
    return f'{value:.17g}' if isinstance(value, float) else str(value)


def openmvg_files(solution: Solution) -> dict[str, bytes]:
    """Return the scene, whose views, poses and landmarks are our numbers.

    `landmark_labels.json` has the IDs of targets.
    """
    network, start = solution.network, solution.state
    posed, tracks = oriented(solution), by_target(solution)
    folders = {str(PurePath(network.photographs[number]).parent) for number in posed}
    root = folders.pop() if len(folders) == 1 else ''
    pointers, kinds = count(1), dict[str, int]()
    scene = {
        'sfm_data_version': '0.3',
        'root_path': root,
        'views': [_openmvg_view(solution, number, bool(root), pointers) for number in posed],
        'intrinsics': [
            _openmvg_intrinsic(solution, camera, kinds, pointers)
            for camera in np.flatnonzero(solution.calibrated).tolist()
        ],
        'extrinsics': [
            _entry(
                number,
                rotation=start.rotations[number].tolist(),
                center=start.positions[number].tolist(),
            )
            for number in posed
        ],
        'structure': [
            _entry(
                target,
                X=start.points[target].tolist(),
                observations=[
                    _entry(it.photograph, id_feat=target, x=it.xy.tolist()) for it in seen
                ],
            )
            for target, seen in tracks.items()
        ],
        'control_points': [],
    }
    labels = {target: network.targets[target] for target in tracks}
    return {'sfm_data.json': _json(scene), 'landmark_labels.json': _json(labels)}


def _openmvg_view(
    solution: Solution, number: int, in_root: bool, pointers: Iterator[int]
) -> dict[str, Any]:
    network = solution.network
    camera = int(network.camera_of[number])
    data = {
        'local_path': '',
        'filename': file_name(solution, number) if in_root else network.photographs[number],
        'width': network.cameras[camera].width,
        'height': network.cameras[camera].height,
        'id_view': number,
        'id_intrinsic': camera,
        'id_pose': number,
    }
    pointer = {'id': _NEW | next(pointers), 'data': data}
    return _entry(number, polymorphic_id=_PLAIN, ptr_wrapper=pointer)


def _openmvg_intrinsic(
    solution: Solution, camera: int, kinds: dict[str, int], pointers: Iterator[int]
) -> dict[str, Any]:
    view, lens = solution.network.cameras[camera], lens_of(solution, camera, square=True)
    name, field = ('fisheye',) * 2 if view.equidistant else ('pinhole_brown_t2', 'disto_t2')
    data = {
        'width': view.width,
        'height': view.height,
        'focal_length': lens.fx,
        'principal_point': [lens.cx, lens.cy],
        field: _distortion(lens, view.equidistant),
    }
    kind: dict[str, Any] = {'polymorphic_id': kinds.get(name, _NEW | len(kinds) + 1)}
    if name not in kinds:  # which names the type for all
        kinds[name] = len(kinds) + 1
        kind['polymorphic_name'] = name
    return _entry(camera, **kind, ptr_wrapper={'id': _NEW | next(pointers), 'data': data})


def _entry(key: int, **value: Any) -> dict[str, Any]:
    return {'key': key, 'value': value}


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + '\n').encode()
