"""Trigger a scanner, wait for the targets of that very image, print them, and move on.

    ros2 launch ahf_ros rig.launch.py driver:=zivid
    python trigger.py 4 > targets.csv

The number is that of the shots. The trigger is a service of type std_srvs/Trigger, as that of
zivid_camera. Every image has an answer with its stamp, also one that is refused or dropped; each
step has a time limit, and what does not come in time is named. The topics are remapped as for any
node: --ros-args -r capture:=/left/capture -r camera_info:=/left/color/camera_info.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from ahf_ros.msg import CodedTargetArray
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import CameraInfo
from std_srvs.srv import Trigger

START = 30.0  # time limit until scanner and detector are there, s
CAPTURE = 30.0  # ... from the trigger to the header of the image
ANSWER = 60.0  # ... from there to the answer
STATUS = {
    CodedTargetArray.OK: 'ok',
    CodedTargetArray.REJECTED: 'rejected',
    CodedTargetArray.DROPPED: 'dropped',
    CodedTargetArray.FAILED: 'failed',
}


class Cell(Node):
    """Triggers a scanner and knows what was identified in which of its images."""

    def __init__(self) -> None:
        super().__init__('cell')
        self.trigger = self.create_client(Trigger, 'capture')
        # camera_info has the header of the image and is small. It is reliable here, as that of
        # most drivers; one that sends it as sensor data needs qos_profile_sensor_data.
        self.headers: list[tuple[int, int]] = []
        self.seen = self.create_subscription(CameraInfo, 'camera_info', self.taken, 10)
        self.answers: dict[tuple[int, int], CodedTargetArray] = {}
        self.heard = self.create_subscription(
            CodedTargetArray, 'coded_targets', self.answered, 1000
        )

    def taken(self, camera: CameraInfo) -> None:
        """Note the stamp of an image."""
        self.headers.append((camera.header.stamp.sec, camera.header.stamp.nanosec))

    def answered(self, answer: CodedTargetArray) -> None:
        """Keep an answer until somebody asks for it."""
        self.answers[answer.header.stamp.sec, answer.header.stamp.nanosec] = answer

    def until(self, what: str, limit: float, found: Callable[[], Any]) -> Any:
        """Return what is found, or raise a TimeoutError that says what did not come."""
        end = time.monotonic() + limit
        while not (result := found()):
            if time.monotonic() > end:
                raise TimeoutError(f'{what} did not come within {limit:g} s')
            rclpy.spin_once(self, timeout_sec=0.05)
        return result

    def wait(self) -> None:
        """Wait until what is needed is there."""
        self.until(f'service {self.trigger.srv_name}', START, self.trigger.service_is_ready)
        for it in (self.heard, self.seen):
            self.until(f'a publisher of {it.topic_name}', START, it.get_publisher_count)

    def shot(self) -> CodedTargetArray:
        """Trigger the scanner and return the answer to the image that it takes."""
        self.headers.clear()
        self.answers.clear()
        called = self.trigger.call_async(Trigger.Request())
        try:
            response = self.until('the response of the scanner', CAPTURE, called.result)
        finally:
            self.trigger.remove_pending_request(called)
        if not response.success:
            raise RuntimeError(f'the scanner refuses: {response.message}')
        stamp = self.until('the camera_info of the image', CAPTURE, lambda: self.headers)[-1]
        name = f'the answer to the image of {stamp[0]}.{stamp[1]:09} s'
        answer: CodedTargetArray = self.until(name, ANSWER, lambda: self.answers.get(stamp))
        return answer


def main() -> int:
    """Make the shots, and print a line for every target."""
    rclpy.init()
    cell = Cell()
    shots = int((remove_ros_args(sys.argv)[1:] or ['1'])[0])
    failed = 0
    print('shot,id,x,y,family', flush=True)
    try:
        cell.wait()
        for number in range(1, shots + 1):
            # This is where a robot or a turntable would be moved.
            try:
                answer = cell.shot()
            except (TimeoutError, RuntimeError) as error:
                print(f'shot {number}: {error}', file=sys.stderr)
                failed += 1
                continue
            for it in answer.targets:
                print(f'{number},{it.id},{it.x:.3f},{it.y:.3f},{it.family}', flush=True)
            reason = f': {answer.reason}' if answer.reason else ''
            print(f'shot {number} {STATUS[answer.status]}{reason}', file=sys.stderr)
            failed += answer.status != CodedTargetArray.OK
    except TimeoutError as error:
        print(error, file=sys.stderr)
        failed = shots
    except KeyboardInterrupt:
        failed = shots
    finally:
        cell.destroy_node()
        rclpy.try_shutdown()
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
