"""Pair what the cameras of a rig identify at the same time, and print where all of them see it.

Start a detector for each camera, then this program:

    ros2 launch ahf_ros detector.launch.py namespace:=left image:=/left/image_raw
    ros2 launch ahf_ros detector.launch.py namespace:=right image:=/right/image_raw
    python rig.py left right > pairs.csv

The cameras have to be triggered together, so that their images have the same stamp.
"""

from __future__ import annotations

import sys
from functools import partial

import rclpy
from ahf_ros.msg import CodedTargetArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

WAITING = 100
"""Stamps that wait for the other cameras; one of them may have lost an image."""


class Rig(Node):
    """Listens to the detectors of several cameras."""

    def __init__(self, cameras: list[str]) -> None:
        super().__init__('rig')
        self.cameras = cameras
        self.waiting: dict[tuple[int, int], dict[str, CodedTargetArray]] = {}
        for camera in cameras:
            topic, heard = f'/{camera}/coded_targets', partial(self.answered, camera)
            self.create_subscription(CodedTargetArray, topic, heard, 1000)
        print('stamp', 'id', *(f'{camera}_{axis}' for camera in cameras for axis in 'xy'), sep=',')

    def answered(self, camera: str, answer: CodedTargetArray) -> None:
        """Keep an answer until those of the other cameras are there."""
        stamp = answer.header.stamp.sec, answer.header.stamp.nanosec
        together = self.waiting.setdefault(stamp, {})
        together[camera] = answer
        if len(together) == len(self.cameras):
            del self.waiting[stamp]
            self.paired(stamp, [together[name] for name in self.cameras])
        while len(self.waiting) > WAITING:
            del self.waiting[min(self.waiting)]

    def paired(self, stamp: tuple[int, int], answers: list[CodedTargetArray]) -> None:
        """Print the targets that every camera sees; this is where rays would be intersected."""
        seen = [{it.id: it for it in answer.targets if it.id >= 0} for answer in answers]
        for number in sorted(set.intersection(*map(set, seen))):
            places = [f'{of[number].x:.3f},{of[number].y:.3f}' for of in seen]
            print(f'{stamp[0]}.{stamp[1]:09}', number, *places, sep=',', flush=True)


def main() -> None:
    """Listen until Ctrl-C."""
    rclpy.init()
    node = Rig(sys.argv[1:] or ['left', 'right'])
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
