"""Every reader of files, with files that it reads: what tests damage.

A reader that is missing here fails a test, see `ahf_ros.base.opening.reader`.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.extras import missing
from ahf_ros.cli.identify import image_paths
from ahf_ros.files.arrays import read_arrays
from ahf_ros.files.cloud_files import read_cloud, write_pcd, write_ply
from ahf_ros.files.exif import read_exif
from ahf_ros.files.image_files import read_noted_image
from ahf_ros.files.tables import POINT, read_by_image, read_points, read_table
from ahf_ros.files.target_json import read_results
from ahf_ros.files.truth_files import read_truth
from ahf_ros.network.export.survey import read_measured_images
from ahf_ros.network.files.camera_files import read_camera
from ahf_ros.network.files.control_files import read_control, read_lengths, read_scale_bars
from ahf_ros.network.files.coordinate_files import read_coordinates
from ahf_ros.network.files.network_files import read_cameras
from ahf_ros.network.files.network_results import read_network, write_network
from ahf_ros.network.files.observation_files import read_observations
from ahf_ros.network.files.robot_files import read_robot_poses, read_stations
from ahf_ros.prints import RING_FOLDER
from ahf_ros.prints.data_file import read_data_file
from ahf_ros.prints.dots import DOTS_DESIGN, dot_family
from ahf_ros.prints.gsi import GSI_LIBRARY, point_family
from ahf_ros.prints.ring import ring_family
from ahf_ros.views.report.results import read_results as read_shown
from support.networks import records, simulated, solution

RING = """family: mine
bits: 12
band: [2, 3]
pinhole: 0.1
polarity: dark
words: {parity: even, zeros: [4, 8]}
numbers: {first_bit: lowest}
"""
CODES = 'family: mine\nbits: 8\nband: [[2, 2.1], [3, 3.1]]\ncodes: {1: 0b1011, 2: 23, 3: 0x37}\n'
CAMERA = """image_width: 640
image_height: 480
camera_name: "left"
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 600., 0., 320., 0., 600., 240., 0., 0., 1. ]
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.01, 1e-3, -1e-3, 0]}
"""
KALIBR = """cam0:
  camera_model: pinhole
  intrinsics: [600, 600, 320, 240]
  distortion_model: radtan
  distortion_coeffs: [-0.1, 0.01, 0.001, 0]
  resolution: [640, 480]
"""
CONTROL = 'id,x,y,z,sigma_x,sigma_y,sigma_z,role,unit\n1,1.5,2,3,0.1,0.1,0.1,check,mm\n'
DECIMAL_COMMAS = '#Label;Y/North_(m);X/East (m);Z/Altitude\ntarget 5;1,5;2,25;-3e-1\n6;4,0;5;6\n'
LIST = 'CODE1,1.5,2.5,3.5,0.01,0.01,0.01,0\nNUGGET1_A,4.5,5.5,6.5,0.1,0.1,0.1,0\n'
ROBOT = 'image,x,y,z,qx,qy,qz,qw\na.png,1,2,3,0,0,0,1\nb.png,1,2,3,0.6,0,0,0.8\n'
OBSERVED = (
    'image,id,x,y,sigma,width,height\na.png,1,20.5,30.5,0.1,640,480\nb.png,1,5,6,0.1,640,480\n'
)
JSON_POINTS = '{"unit": "m", "points": [{"id": "1", "x": 1, "y": 2.5, "z": 3}]}'


@dataclass(frozen=True)
class Sample:
    """What a reader reads: the name of a file, its content, and whether that is text."""

    read: Callable[[Path], Any]
    name: str
    content: bytes
    text: bool = True
    beside: tuple[tuple[str, bytes], ...] = ()


def samples(folder: Path) -> Iterator[Sample]:
    """Yield samples of all readers; the folder is for files that are made on the way."""
    yield from _tables()
    yield from _results()
    yield from _networks(folder)
    yield from _images()
    yield from _clouds()
    for content in (RING, CODES, json.dumps({'family': 'mine', 'bits': 12, 'band': [2, 3]})):
        yield Sample(lambda it: ring_family(str(it)), 'mine.yaml', content.encode())
    yield Sample(
        lambda it: ring_family(str(it)), 'a.json', (RING_FOLDER / 'aicon14.json').read_bytes()
    )
    yield Sample(lambda it: point_family(str(it)), 'a.json', Path(GSI_LIBRARY).read_bytes())
    yield Sample(lambda it: dot_family(str(it)), 'a.json', Path(DOTS_DESIGN).read_bytes())
    yield Sample(read_data_file, 'a.yaml', b'a: &b [1, .inf, {c: "d"}]\nb: |\n  # text\n')
    for content in (CAMERA, '%YAML:1.0\n---\n' + CAMERA, KALIBR):
        yield Sample(read_camera, 'a.yaml', content.encode())


def _tables() -> Iterator[Sample]:
    bars = b'id_1,id_2,length,sigma,role\n1,2,100.5,0.01,control\n2,target 3,50,0.01,check\n'
    yield Sample(read_scale_bars, 'a.csv', bars)
    yield Sample(read_lengths, 'a.csv', b'id_1\tid_2\tlength\tsigma\tline\n1\t2\t100,5\t0,1\tA\n')
    for content in (CONTROL, DECIMAL_COMMAS, LIST):
        for read in (read_control, read_points, read_coordinates):
            yield Sample(read, 'a.csv', content.encode())
        yield Sample(lambda it: read_table(it, POINT), 'a.csv', content.encode())
    yield Sample(read_cameras, 'a.csv', b'image,camera\na.png,A\nb.png,B\n')
    yield Sample(lambda it: read_by_image(it, 'camera'), 'a.csv', b'image;camera\na.png;A\n')
    yield Sample(read_stations, 'a.csv', b'image,station\na.png,1\nb.png,2\n')
    yield Sample(read_robot_poses, 'a.csv', ROBOT.encode())
    yield Sample(
        read_truth, 'a.csv', b'image,id,x,y,confirmed\na.png,1,2.5,3.5,1\nb.png,1,2,3,0\n'
    )
    yield Sample(read_observations, 'a.csv', OBSERVED.encode())
    yield Sample(lambda it: image_paths([f'@{it}']), 'a.txt', b'a.png\nb c.jpg\n')


def _results() -> Iterator[Sample]:
    network, _ = simulated(2, 3)
    lines = ''.join(json.dumps(it) + '\n' for it in records(network))
    for read in (read_results, read_measured_images, read_observations):
        yield Sample(read, 'a.jsonl', lines.encode())
    yield Sample(_shown, 'a.jsonl', lines.encode())
    yield Sample(_shown, 'a.json', json.dumps([*map(json.loads, lines.splitlines())]).encode())
    yield Sample(read_coordinates, 'a.json', JSON_POINTS.encode())


def _shown(path: Path) -> None:
    """Read results for a report, which collects what is wrong."""
    read_shown([path])


def _of_folder(read: Callable[[Path], object], file: Path) -> object:
    return read(file.parent)


def _networks(folder: Path) -> Iterator[Sample]:
    write_network(folder, solution(3, 8))
    archive, network = (
        (folder / it).read_bytes() for it in ('covariance_of_points.npz', 'network.json')
    )
    others = tuple((it.name, it.read_bytes()) for it in folder.iterdir())
    readers: tuple[Callable[[Path], object], ...] = (read_network, read_coordinates)
    for read in readers:
        yield Sample(partial(_of_folder, read), 'network.json', network, beside=others)
    yield Sample(
        lambda it: read_network(it.parent), 'covariance_of_points.npz', archive, False, others
    )
    shapes = {'ids': ('U', (8,)), 'covariance': ('f', (24, 24)), 'scaled': ('b', ())}
    yield Sample(lambda it: read_arrays(it, shapes), 'a.npz', archive, False)


def _images() -> Iterator[Sample]:
    image = np.random.default_rng(1).integers(0, 255, (24, 32), np.uint8)
    for suffix in ('.png', '.jpg', '.tif', '.bmp', '.webp'):
        _, encoded = cv2.imencode(suffix, image)
        for read in (read_noted_image, read_exif):
            yield Sample(read, f'a{suffix}', encoded.tobytes(), False)
    if not missing('heic'):
        from pillow_heif import from_bytes

        file = BytesIO()
        from_bytes(mode='L', size=(32, 24), data=image.tobytes()).save(file, quality=90)
        for read in (read_noted_image, read_exif):
            yield Sample(read, 'a.heic', file.getvalue(), False)


def _clouds() -> Iterator[Sample]:
    cloud = np.zeros((2, 3), [(it, '<f4') for it in 'xyz'] + [('red', 'u1')])
    for suffix, write in (('ply', write_ply), ('pcd', write_pcd)):
        yield Sample(read_cloud, f'a.{suffix}', write(cloud), False)
    ascii_ply = (
        'ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n'
        'property float z\nproperty uchar red\nend_header\n1 2 3 4\n5 6 nan 7\n'
    )
    yield Sample(read_cloud, 'a.ply', ascii_ply.encode())
    ascii_pcd = (
        'VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n'
        'POINTS 2\nDATA ascii\n1 2 3\n4 5 6\n'
    )
    yield Sample(read_cloud, 'a.pcd', ascii_pcd.encode())
