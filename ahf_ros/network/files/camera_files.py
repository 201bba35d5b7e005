"""Calibrations of cameras as YAML, as ROS and as OpenCV write them."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.opening import LARGEST, Most, read_text, reader
from ahf_ros.base.parsed_yaml import parsed_yaml
from ahf_ros.base.text import shown
from ahf_ros.files.files import text_of
from ahf_ros.network.camera import (
    EQUIDISTANT,
    PARAMETERS,
    distortion_by_coefficient,
    parameters_of,
)
from ahf_ros.network.network import CameraView, FloatArray
from ahf_ros.network.points import correlations, standard_deviations

BROWN = ('', 'plumb_bob', 'rational_polynomial')
"""Names of Brown's model; the last one has more coefficients, which it stands for."""

FISHEYE = ('equidistant', 'fisheye')
"""Names of the model of Kannala and Brandt."""

_MORE = (
    (slice(12, 14), 'a tilted sensor'),
    (slice(8, 12), 'a thin prism'),
    (slice(5, 8), 'the rational model'),
)
"""What further coefficients of OpenCV are for."""

_FOLLOWED = 0.1  # px, by which Brown's model may differ from that of more coefficients
_COLUMNS, _ROWS = 33, 25  # of places in an image at which they are compared

_KALIBR = {'radtan': 'plumb_bob', 'none': '', 'equidistant': 'equidistant'}
"""Kalibr's models of distortion, as ROS calls them."""

_COEFFICIENTS: Sequence[str] = ('k1', 'k2', 'p1', 'p2', 'k3')  # in the order of ROS and OpenCV
_OF_FISHEYE: Sequence[str] = ('k1', 'k2', 'k3', 'k4')
_NAMES: Mapping[str, Sequence[str]] = {
    'width': ('image_width', 'width'),
    'height': ('image_height', 'height'),
    'matrix': ('camera_matrix', 'Camera_Matrix', 'K', 'k'),
    'distortion': ('distortion_coefficients', 'Distortion_Coefficients', 'D', 'd'),
}
"""What files call a field: those of ROS, and those of OpenCV's samples."""


@dataclass(frozen=True)
class CameraFile:
    """A calibration in the order of `PARAMETERS`, and the size of its images in px.

    It may be that of an `equidistant` fisheye lens.
    """

    path: str
    name: str
    width: int
    height: int
    calibration: FloatArray
    equidistant: bool = False

    def check(self, image: str, width: int, height: int) -> None:
        """Raise a ValueError that names both sizes if an image has another one."""
        if (width, height) == (self.width, self.height):
            return
        turned = ''
        if (height, width) == (self.width, self.height):
            turned = '; portrait and landscape differ: identify without --upright'
        raise ValueError(
            f'{self.path} is of images of {self.width} x {self.height} px, {image} has '
            f'{width} x {height} px, accepted is the same size{turned}'
        )


@reader('a calibration as ROS, OpenCV or Kalibr write it')
def read_camera(path: str | Path) -> CameraFile:
    """Return the calibration in a file of ROS (camera_info), OpenCV (FileStorage) or Kalibr.

    Brown's coefficients stand for OpenCV's rational model, a thin prism or a tilted sensor, as far
    as these agree. A ValueError names the file, and the field that is missing, damaged or of
    another model.
    """
    content = _without_kalibr(_parsed(read_text(path, Most.YAML), str(path)), path)
    width, height = (_whole(content, name, path) for name in ('width', 'height'))
    matrix = _numbers(content, 'matrix', path)
    distortion = _numbers(content, 'distortion', path, required=False)
    if len(matrix) != 9:
        raise ValueError(f'{path}: camera_matrix has {len(matrix)} numbers, accepted are 9')
    fx, shear, cx, _, fy, cy = matrix[:6]
    if not (fx > 0 and fy > 0):
        raise ValueError(
            f'{path}: camera_matrix has the focal lengths {fx:g} and {fy:g}, accepted are numbers '
            'above 0'
        )
    model = content.get('distortion_model') or ''
    if model not in (*BROWN, *FISHEYE):
        raise ValueError(
            f"{path}: distortion_model is {shown(model)}, accepted is plumb_bob, Brown's, or "
            'equidistant, that of Kannala and Brandt'
        )
    if model in FISHEYE and len(distortion) not in (0, 4):
        raise ValueError(
            f'{path}: distortion_coefficients are {distortion}, accepted of an equidistant lens '
            'are 4 numbers: k1, k2, k3, k4'
        )
    if model not in FISHEYE and len(distortion) not in (0, 4, 5, 8, 12, 14):
        raise ValueError(
            f'{path}: distortion_coefficients are {distortion}, accepted are 4 or 5 numbers: k1, '
            'k2, p1, p2, k3; or 8, 12 or 14, as OpenCV orders them'
        )
    if any(distortion[5:]):
        distortion = _as_brown(np.reshape(matrix, (3, 3)), distortion, width, height, path)
    fisheye = model in FISHEYE
    names = EQUIDISTANT if fisheye else PARAMETERS
    coefficients = _OF_FISHEYE if fisheye else _COEFFICIENTS
    value = dict.fromkeys(names, 0.0) | {'f': fy, 'cx': cx, 'cy': cy}
    value |= dict(zip(coefficients, distortion, strict=False))
    value |= {'affinity': fx / fy - 1, 'shear': shear / fy}
    name = content.get('camera_name') or Path(path).stem
    calibration = np.array([value[it] for it in names])
    return CameraFile(str(path), str(name), width, height, calibration, fisheye)


def _as_brown(
    matrix: FloatArray, distortion: list[float], width: int, height: int, path: str | Path
) -> list[float]:
    """Return Brown's coefficients that distort an image most as those of another model do, (5,).

    Distorted places are linear in them. A ValueError says by how much they differ, if they do.
    """
    across, down = np.linspace(0, width - 1, _COLUMNS), np.linspace(0, height - 1, _ROWS)
    places = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    inverse = np.linalg.inv(matrix)
    points = np.column_stack([places, np.ones(len(places))]) @ inverse.T
    lens = np.zeros(3), np.zeros(3), matrix, np.array(distortion)
    before = np.inf
    while True:
        imaged = cv2.projectPoints(points, *lens)[0][:, 0]
        off = np.linalg.norm(imaged - places, axis=1).max()
        if off < _FOLLOWED or not off < before:
            break
        before = off
        points[:, :2] -= (imaged - places) @ inverse[:2, :2].T
    ideal, coefficients = points[:, :2], np.zeros(len(_COEFFICIENTS))
    if off < _FOLLOWED:
        moved = (np.column_stack([imaged, points[:, 2]]) @ inverse.T)[:, :2] - ideal
        basis = distortion_by_coefficient(ideal)
        coefficients = np.linalg.lstsq(basis.reshape(moved.size, -1), moved.ravel(), rcond=None)[0]
        off = matrix[0, 0] * np.linalg.norm(basis @ coefficients - moved, axis=1).max()
    if not off < _FOLLOWED:
        more = next(it for place, it in _MORE if any(distortion[place]))
        raise ValueError(
            f'{path}: distortion_coefficients are {distortion}, those of {more}, from which k1, '
            f'k2, p1, p2, k3 differ by {off:.2g} px, accepted is less than {_FOLLOWED} px'
        )
    value = dict(zip(PARAMETERS[3:8], coefficients.tolist(), strict=True))
    return [value[name] for name in _COEFFICIENTS]


def ros_yaml(view: CameraView, calibration: FloatArray, covariance: FloatArray) -> bytes:
    """Return a calibration as ROS' camera_calibration_parsers read it.

    Standard deviations and correlations of the parameters follow, which those leave alone. ROS
    has no shear: it is dropped.
    """
    matrix, _ = _opencv(view, calibration)
    rows = [
        *_rows(view, calibration, covariance, _ros_matrix),
        _ros_matrix('rectification_matrix', np.eye(3)),
        _ros_matrix('projection_matrix', np.column_stack((matrix, np.zeros(3)))),
    ]
    return text_of(rows)


def opencv_yaml(view: CameraView, calibration: FloatArray, covariance: FloatArray) -> bytes:
    """Return a calibration as cv2.FileStorage reads it, with the same fields as `ros_yaml`."""
    rows = _rows(view, calibration, covariance, _opencv_matrix)
    return text_of(('%YAML:1.0', '---', *rows))


def _rows(
    view: CameraView,
    calibration: FloatArray,
    covariance: FloatArray,
    written: Callable[[str, FloatArray], str],
) -> list[str]:
    """Return the fields that both formats have, matrices as one of them writes them."""
    matrix, distortion = _opencv(view, calibration)
    return [
        f'image_width: {view.width}',
        f'image_height: {view.height}',
        f'camera_name: {_quoted(view.name)}',
        written('camera_matrix', matrix),
        f'distortion_model: {"equidistant" if view.equidistant else "plumb_bob"}',
        written('distortion_coefficients', distortion[None]),
        f'parameters: [{", ".join(it or "none" for it in parameters_of(view))}]',
        written('standard_deviations', standard_deviations(covariance)[None]),
        written('correlations', correlations(covariance)),
    ]


def _opencv(view: CameraView, calibration: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return camera matrix and distortion (5,) or (4,), without the shear, which OpenCV lacks."""
    value = dict(zip(parameters_of(view), calibration, strict=True))
    f = value['f']
    matrix = np.array(
        [[f * (1 + value['affinity']), 0, value['cx']], [0, f, value['cy']], [0, 0, 1]]
    )
    coefficients = _OF_FISHEYE if view.equidistant else _COEFFICIENTS
    return matrix, np.array([value[it] for it in coefficients])


def _listed(matrix: FloatArray) -> str:
    return ', '.join(f'{value:.12g}' if value % 1 else f'{value:.1f}' for value in matrix.ravel())


def _ros_matrix(name: str, matrix: FloatArray) -> str:
    rows, columns = matrix.shape
    return f'{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{_listed(matrix)}]'


def _opencv_matrix(name: str, matrix: FloatArray) -> str:
    rows, columns = matrix.shape
    return (
        f'{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n'
        f'   data: [ {_listed(matrix)} ]'
    )


def _quoted(name: str) -> str:
    escaped = name.replace('\\', '\\\\').replace('"', '\\"')
    return f'"{escaped}"'


def _parsed(text: str, path: str) -> dict[str, Any]:
    """Return the mapping in YAML of ROS or of OpenCV, whose first line is no YAML."""
    lines = text.splitlines()
    if lines and lines[0].startswith('%YAML'):
        lines[0] = ''
    text = '\n'.join(lines).replace('!!opencv-matrix', '')
    content = parsed_yaml(text, path)
    if not isinstance(content, dict):
        raise ValueError(f'{path} has no fields, accepted is a calibration of ROS or OpenCV')
    return content


def _without_kalibr(content: dict[str, Any], path: str | Path) -> dict[str, Any]:
    """Return the fields of ROS for a camera of Kalibr, any other content as it is."""
    cameras = [it for it in content if re.fullmatch(r'cam[0-9]+', str(it))]
    if not cameras:
        return content
    camera = content[cameras[0]]
    if len(cameras) > 1:
        raise ValueError(f'{path} has {", ".join(cameras)}, accepted is one camera a file')
    if not isinstance(camera, dict) or camera.get('camera_model') != 'pinhole':
        model = camera.get('camera_model') if isinstance(camera, dict) else None
        raise ValueError(f'{path}: camera_model is {shown(model)}, accepted is pinhole')
    intrinsics, size = (camera.get(it) for it in ('intrinsics', 'resolution'))
    if not (isinstance(intrinsics, list) and len(intrinsics) == 4):
        raise ValueError(f'{path}: intrinsics is {shown(intrinsics)}, accepted is fx, fy, cx, cy')
    width, height = size if isinstance(size, list) and len(size) == 2 else (None, None)
    fx, fy, cx, cy = intrinsics
    model = camera.get('distortion_model', 'none')
    return {
        'image_width': width,
        'image_height': height,
        'camera_matrix': [fx, 0, cx, 0, fy, cy, 0, 0, 1],
        'distortion_coefficients': camera.get('distortion_coeffs', []),
        'distortion_model': _KALIBR.get(model, model),
    }


def _field(content: dict[str, Any], name: str) -> Any:
    return next((content[it] for it in _NAMES[name] if it in content), None)


def _whole(content: dict[str, Any], name: str, path: str | Path) -> int:
    value = _field(content, name)
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ValueError(
            f'{path}: image_{name} is {shown(value)}, accepted is the size of the images in px'
        )
    return value


def _numbers(
    content: dict[str, Any], name: str, path: str | Path, required: bool = True
) -> list[float]:
    """Return the numbers of a matrix, row after row."""
    value = _field(content, name)
    if value is None and not required:
        return []
    found = value.get('data') if isinstance(value, dict) else value
    rows = found if isinstance(found, list) else [math.nan]
    flat = [it for row in rows for it in (row if isinstance(row, list) else [row])]
    if not all(type(it) in (int, float) and abs(it) <= LARGEST for it in flat):
        raise ValueError(
            f'{path}: {_NAMES[name][0]} is {shown(found)}, accepted are finite numbers'
        )
    return [float(it) for it in flat]
