"""Surveys as a database of COLMAP, and adjusted networks as a model of it in text.

COLMAP has (0, 0) at the corner of the first pixel, so that 0.5 is added. Its models have no shear,
and its points no names: `point_labels.csv` has those.
"""

import os
import sqlite3
import tempfile
from contextlib import closing
from itertools import combinations
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import file_errors
from ahf_ros.files.files import csv_table, text_of
from ahf_ros.network.export.adjusted import lens_of, numbers
from ahf_ros.network.export.survey import Survey
from ahf_ros.network.solution import Solution
from ahf_ros.network.transform import Transform

DATABASE = 'targets.db'

# The schema of the documentation, up to 3.11; later versions add their tables when they open it.
SCHEMA = """
PRAGMA user_version = 3800;
CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
    model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,
    prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
    name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL,
    CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
    FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
    cols INTEGER NOT NULL, data BLOB,
    FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
    cols INTEGER NOT NULL, data BLOB,
    FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
    cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
    cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB,
    qvec BLOB, tvec BLOB);
"""
SIMPLE_RADIAL = 2
FOCAL_LENGTH = 1.2  # that COLMAP assumes without EXIF, as a share of the longer side
UNCALIBRATED = 3  # geometry of two views whose matches are right and whose cameras are not known
IMAGES = 2147483647  # factor that makes one number of the two of a pair of images


_SHIFT = 0.5
_GRAY = '128 128 128'


def colmap_files(survey: Survey) -> dict[str, bytes]:
    """Return a database, and a table with the label of each keypoint.

    Images are named from the folder that they have in common. Those of one size get one camera,
    whose parameters are for COLMAP to adjust. Points with the same label are matched between all
    images, as two-view geometries, so that no descriptors are needed.

    A ValueError is raised if the database cannot be made, such as on a full disk.
    """
    paths = [os.path.abspath(it.path) for it in survey.photographs]  # noqa: PTH100  need not exist
    common = os.path.commonpath([os.path.dirname(path) for path in paths])  # noqa: PTH120
    names = [Path(path).relative_to(common).as_posix() for path in paths]
    labels = [
        (name, number, mark.label)
        for name, photograph in zip(names, survey.photographs, strict=True)
        for number, mark in enumerate(photograph.marks)
    ]
    return {
        'keypoints.csv': csv_table([('image', 'keypoint', 'label'), *labels]),
        DATABASE: _database(survey, names),
    }


def _database(survey: Survey, names: list[str]) -> bytes:
    # sqlite3 can only serialise a database in memory from Python 3.11 on.
    with file_errors(DATABASE, 'written'), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / DATABASE
        try:
            with closing(sqlite3.connect(path)) as connection, connection:
                connection.execute('PRAGMA synchronous = OFF')  # of a temporary file
                connection.executescript(SCHEMA)
                _fill(connection, survey, names)
        except sqlite3.Error as error:
            raise ValueError(f'{DATABASE} cannot be written: {error}') from error
        return path.read_bytes()


def _fill(connection: sqlite3.Connection, survey: Survey, names: list[str]) -> None:
    cameras: dict[tuple[int, int], int] = {}
    rows = []
    for number, photograph in enumerate(survey.photographs, start=1):
        size = photograph.width, photograph.height
        if size not in cameras:
            cameras[size] = len(cameras) + 1
            parameters = [FOCAL_LENGTH * max(size), size[0] / 2, size[1] / 2, 0.0]
            camera = (cameras[size], SIMPLE_RADIAL, *size, _blob(parameters, '<f8'), 0)
            connection.execute('INSERT INTO cameras VALUES (?, ?, ?, ?, ?, ?)', camera)
        image = (number, names[number - 1], cameras[size])
        connection.execute('INSERT INTO images VALUES (?, ?, ?)', image)
        places = [(mark.x, mark.y) for mark in photograph.marks]
        keypoints = (number, len(places), 2, _blob(places, '<f4'))
        connection.execute('INSERT INTO keypoints VALUES (?, ?, ?, ?)', keypoints)
        rows.append({mark.label: row for row, mark in enumerate(photograph.marks)})
    for (first, here), (second, there) in combinations(enumerate(rows, start=1), 2):
        shared = [(row, there[label]) for label, row in here.items() if label in there]
        if shared:
            match = (first * IMAGES + second, len(shared), 2, _blob(shared, '<u4'))
            connection.execute('INSERT INTO matches VALUES (?, ?, ?, ?)', match)
            connection.execute(
                'INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) '
                'VALUES (?, ?, ?, ?, ?)',
                (*match, UNCALIBRATED),
            )


def _blob(values: object, dtype: str) -> bytes:
    return np.asarray(values, dtype).tobytes()


def colmap_model_files(solution: Solution) -> dict[str, bytes]:
    """Return the model, whose identifiers are places in the network from 1 on.

    A ValueError is raised if the name of a photograph does not print.
    """
    points_of = _points_of_images(solution)
    labels = [
        (index + 1, name)
        for index, name in enumerate(solution.network.targets)
        if solution.determined[index]
    ]
    return {
        'cameras.txt': text_of(_cameras(solution)),
        'images.txt': text_of(_images(solution, points_of)),
        'points3D.txt': text_of(_points(solution, points_of)),
        'point_labels.csv': csv_table([('point3D_id', 'id'), *labels]),
    }


def _points_of_images(solution: Solution) -> list[list[int]]:
    """Return the used observations of each photograph with a pose, in their order."""
    network, values = solution.network, solution.state
    lists: list[list[int]] = [[] for _ in network.photographs]
    known = values.used & solution.determined[network.observations.point]
    for row in np.flatnonzero(known):
        lists[network.observations.photograph[row]].append(int(row))
    return lists


def _cameras(solution: Solution) -> list[str]:
    """Return cameras: FULL_OPENCV without its denominator, and OPENCV_FISHEYE."""
    lines = ['# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]']
    for index, view in enumerate(solution.network.cameras):
        if not solution.calibrated[index]:
            continue
        lens = lens_of(solution, index)
        values = [lens.fx, lens.fy, lens.cx + _SHIFT, lens.cy + _SHIFT, lens.k1, lens.k2]
        if view.equidistant:
            model, values = 'OPENCV_FISHEYE', [*values, lens.k3, lens.k4]
        else:
            model, values = 'FULL_OPENCV', [*values, lens.p1, lens.p2, lens.k3, 0.0, 0.0, 0.0]
        size = f'{view.width} {view.height}'
        lines.append(f'{index + 1} {model} {size} {numbers(np.array(values))}')
    return lines


def _images(solution: Solution, points_of: list[list[int]]) -> list[str]:
    """Return poses from world to camera, and the image points below each of them."""
    network, values = solution.network, solution.state
    lines = ['# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME, then X, Y, POINT3D_ID']
    for index in np.flatnonzero(solution.oriented):
        name = network.photographs[index]
        if not name.isprintable():
            raise ValueError(f'image is {name!r}, accepted is a name that prints')
        rotation = values.rotations[index]
        x, y, z, w = Transform(rotation).quaternion
        pose = numbers(np.array([w, x, y, z, *(-rotation @ values.positions[index])]))
        lines.append(f'{index + 1} {pose} {network.camera_of[index] + 1} {name}')
        seen = network.observations
        points = [
            f'{seen.xy[row, 0] + _SHIFT:.6f} {seen.xy[row, 1] + _SHIFT:.6f} {seen.point[row] + 1}'
            for row in points_of[index]
        ]
        lines.append(' '.join(points))
    return lines


def _points(solution: Solution, points_of: list[list[int]]) -> list[str]:
    """Return targets with their mean residual in px and the image points that show them."""
    network, values = solution.network, solution.state
    tracks: list[list[tuple[int, int, float]]] = [[] for _ in network.targets]
    for image in np.flatnonzero(solution.oriented):
        for place, row in enumerate(points_of[image]):
            error = float(np.hypot(*solution.residuals[row]))
            tracks[network.observations.point[row]].append((int(image) + 1, place, error))
    lines = ['# POINT3D_ID, X, Y, Z, R, G, B, ERROR, then IMAGE_ID, POINT2D_IDX']
    for index, track in enumerate(tracks):
        if track and solution.determined[index]:
            xyz = numbers(values.points[index])
            mean = np.mean([it[2] for it in track])
            pairs = ' '.join(f'{image} {place}' for image, place, _ in track)
            lines.append(f'{index + 1} {xyz} {_GRAY} {mean:.6g} {pairs}')
    return lines
