"""A scanner for those who have none: a box from all sides, published as zivid_camera does.

    ros2 launch ahf_ros rig.launch.py driver:=zivid registration:=true folder:=scans \
        pose:=true coordinates:=box.csv
    python scanner.py box.csv

The second command writes the coordinates of the targets on two sides of the box, and makes a scan
of two sides for every Enter, until it has been around, and for every call of its service, as of
trigger.py. `ros2 bag record -a` keeps the scans, `ros2 bag play` repeats them.
"""

from __future__ import annotations

import array
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
from ahf_ros import SceneSettings, render
from builtin_interfaces.msg import Time
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header
from std_srvs.srv import Trigger

WIDTH, HEIGHT = 0.20, 0.24  # of a side of the box, m
RESOLUTION = 5000.0  # of its texture, px/m
SEEDS = 1, 2, 3, 4  # of the sides; no ID comes twice
SIZE = 800, 640  # of the images, px
FOCAL_LENGTH = 1100.0  # px
DISTANCE = 0.6  # of the scanner from the axis of the box, m
NOISE = 0.05e-3  # of the cloud, m
FINER = 3  # pixels of a rendering in a row of a pixel
TOPICS = {
    '/points/xyz': PointCloud2,
    '/color/camera_info': CameraInfo,
    '/color/image_color': Image,
}
"""Topics in the order in which a scan is published."""
NEEDED = '/points/xyz', '/color/image_color'  # without subscribers to these, a scan is for nobody
PATIENCE = 30.0  # for them, s


@dataclass(frozen=True)
class Scan:
    """An image and its cloud, and where the scanner is: R x + t in the frame of the box."""

    image: np.ndarray  # (height, width), uint8
    cloud: np.ndarray  # (height, width, 3), m; NaN where nothing is
    rotation: np.ndarray
    position: np.ndarray


def axes(side: int) -> np.ndarray:
    """Return the directions right, down and outward of a side, as columns."""
    turn = np.pi / 2 * side
    outward = np.array([np.cos(turn), np.sin(turn), 0.0])
    return np.column_stack((np.cross([0, 0, 1], outward), [0, 0, -1], outward))


@cache
def texture(side: int) -> Any:
    """Return the picture of a side: a wall seen from the front, without noise and blur."""
    width, height = round(WIDTH * RESOLUTION), round(HEIGHT * RESOLUTION)
    return render(
        SceneSettings(
            width=width,
            height=height,
            targets=6,
            dot_radius=20.0,
            focal_length=20.0,
            full_well=0.0,
            blur=0.0,
            seed=SEEDS[side],
        )
    )


def on_box(side: int) -> np.ndarray:
    """Return the matrix, shape (3, 3), from pixels (x, y, 1) of a texture to points of the box."""
    right, down, outward = axes(side).T
    middle = (np.array([WIDTH, HEIGHT]) * RESOLUTION - 1) / 2
    corner = outward * WIDTH / 2 - (right * middle[0] + down * middle[1]) / RESOLUTION
    return np.column_stack((right / RESOLUTION, down / RESOLUTION, corner))


def coordinates(side: int) -> dict[int, np.ndarray]:
    """Return the coordinates of the targets on a side, m, by ID."""
    return {it.id: on_box(side) @ (it.x, it.y, 1.0) for it in texture(side).targets}


def intrinsics(scale: int = 1) -> np.ndarray:
    """Return the camera matrix of an image with so many pixels in the place of one."""
    x, y = ((scale * side - 1) / 2 for side in SIZE)
    return np.array([[scale * FOCAL_LENGTH, 0, x], [0, scale * FOCAL_LENGTH, y], [0, 0, 1]])


def scan(number: int) -> Scan:
    """Return what the scanner sees before an edge of the box."""
    turn, height = np.pi / 2 * (number + 0.5), 0.1 * (-1) ** number
    position = np.array([DISTANCE * np.cos(turn), DISTANCE * np.sin(turn), height])
    forward = -position / np.linalg.norm(position)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    rotation = np.column_stack((right, np.cross(forward, right), forward))
    random = np.random.default_rng(number)

    finer = np.full((FINER * SIZE[1], FINER * SIZE[0]), 60, np.uint8)
    cloud = np.full((SIZE[1], SIZE[0], 3), np.nan)
    rays = np.dstack((*np.meshgrid(*map(np.arange, SIZE)), np.ones(SIZE[::-1])))
    rays = rays @ np.linalg.inv(intrinsics()).T
    for side in range(len(SEEDS)):
        to_right, down, outward = axes(side).T
        if outward @ position < WIDTH / 2:
            continue
        seen = intrinsics(FINER) @ rotation.T @ (on_box(side) - np.outer(position, (0, 0, 1)))
        cv2.warpPerspective(
            texture(side).image,
            seen,
            finer.shape[::-1],
            dst=finer,
            borderMode=cv2.BORDER_TRANSPARENT,
        )
        depth = (WIDTH / 2 - outward @ position) / (rays @ (rotation.T @ outward))
        points = (rays * depth[:, :, None]) @ rotation.T + position
        inside = np.abs(points @ to_right) < WIDTH / 2
        inside &= np.abs(points @ down) < HEIGHT / 2
        depth += NOISE * random.standard_normal(depth.shape)
        cloud[inside] = (rays * depth[:, :, None])[inside]
    image = cv2.resize(finer, SIZE, interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.6)
    image += random.standard_normal(image.shape)  # type: ignore[arg-type]
    return Scan(np.clip(np.rint(image), 0, 255).astype(np.uint8), cloud, rotation, position)


def messages(of: Scan, nanoseconds: int) -> Iterator[tuple[str, Any]]:
    """Yield topic and message, as zivid_camera publishes them."""
    seconds, rest = divmod(nanoseconds, 10**9)
    header = Header(stamp=Time(sec=seconds, nanosec=rest), frame_id='zivid_optical_frame')
    width, height = SIZE
    cloud = np.zeros((height, width, 4), np.float32)
    cloud[:, :, :3] = of.cloud
    grey, full = of.image, np.full_like(of.image, 255)
    matrix = intrinsics()
    made = (
        PointCloud2(
            header=header,
            height=height,
            width=width,
            fields=[
                PointField(name=name, offset=4 * axis, datatype=PointField.FLOAT32, count=1)
                for axis, name in enumerate('xyz')
            ],
            point_step=16,
            row_step=16 * width,
            data=array.array('B', cloud.tobytes()),
        ),
        CameraInfo(
            header=header,
            height=height,
            width=width,
            distortion_model='plumb_bob',
            d=[0.0] * 5,
            k=matrix.ravel(),
            r=np.eye(3).ravel(),
            p=np.column_stack((matrix, np.zeros(3))).ravel(),
        ),
        Image(
            header=header,
            height=height,
            width=width,
            encoding='rgba8',
            step=4 * width,
            data=array.array('B', np.dstack((grey, grey, grey, full)).tobytes()),
        ),
    )
    yield from zip(TOPICS, made, strict=True)


def table() -> str:
    """Return the coordinates of the targets on the first two sides as CSV."""
    known = coordinates(0) | coordinates(1)
    rows = [f'{name},{x:.9f},{y:.9f},{z:.9f},m' for name, (x, y, z) in sorted(known.items())]
    return '\n'.join(['id,x,y,z,unit', *rows, ''])


class Scanner(Node):
    """Publishes scans from all sides in turn, and waits for those who need them."""

    def __init__(self) -> None:
        super().__init__('zivid_camera')
        self.number = 0
        self.turn = threading.Lock()
        self.made = {name: self.create_publisher(kind, name, 1) for name, kind in TOPICS.items()}
        self.create_service(Trigger, 'capture', self.called)

    def wait(self, topics: Iterable[str], limit: float) -> str:
        """Return the first topic that nobody subscribes to within a limit, s; empty if none."""
        end = time.monotonic() + limit
        for topic in topics:
            while not self.made[topic].get_subscription_count():
                if time.monotonic() > end:
                    return topic
                time.sleep(0.05)
        return ''

    def capture(self) -> str:
        """Publish the next scan; return why it is not published, empty if it is."""
        with self.turn:
            if topic := self.wait(NEEDED, PATIENCE):
                return (
                    f'nobody subscribes to {topic} within {PATIENCE:g} s: start rig.launch.py, '
                    'and something that listens to what it publishes'
                )
            if topic := self.wait(TOPICS, PATIENCE / 10):
                print(f'nobody subscribes to {topic}, as a pose node would: go on without')
            of = scan(self.number % len(SEEDS))
            self.number += 1
            for name, message in messages(of, time.time_ns()):
                self.made[name].publish(message)
            return ''

    def called(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Make a scan for who calls the service."""
        response.message = self.capture()
        response.success = not response.message
        return response


def main() -> None:
    """Write the coordinates, and make a scan for every line on the input until around the box."""
    Path(sys.argv[1]).write_text(table(), encoding='utf-8')
    rclpy.init()
    node = Scanner()
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    try:
        while node.number < len(SEEDS):
            input('Enter: next scan')
            if why := node.capture():
                print(why)
        input('Enter: end')
    except (EOFError, KeyboardInterrupt):
        pass
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
