"""Write a table of the targets in every image of a recording, and how many each camera saw.

Identify them first, which needs no ROS, then run this program:

    ahf bag recording answered --expected-targets 54
    python recording.py answered > targets.csv
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader

ANSWERS = 'ahf_ros/msg/CodedTargetArray'


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table; what is said about the whole goes to standard error."""
    bags = [Path(it) for it in (sys.argv[1:] if arguments is None else arguments)]
    table = csv.writer(sys.stdout)
    table.writerow(('topic', 'stamp', 'id', 'x', 'y', 'confidence'))
    images: Counter[str] = Counter()
    targets: Counter[str] = Counter()
    # A bag has the definitions of its messages, so nothing has to be compiled.
    with AnyReader(bags) as reader:
        answers = [it for it in reader.connections if it.msgtype == ANSWERS]
        for connection, _, data in reader.messages(answers):
            answer: Any = reader.deserialize(data, connection.msgtype)
            if getattr(answer, 'status', 0):  # not identified; older bags do not say so
                print(f'{connection.topic}: {answer.reason}', file=sys.stderr)
                continue
            stamp = f'{answer.header.stamp.sec}.{answer.header.stamp.nanosec:09}'
            images[connection.topic] += 1
            for target in answer.targets:
                if target.id < 0:  # seen, but not identified
                    continue
                targets[connection.topic] += 1
                place = f'{target.x:.3f}', f'{target.y:.3f}', f'{target.confidence:.3f}'
                table.writerow((connection.topic, stamp, target.id, *place))
    for topic, count in images.items():
        mean = targets[topic] / count
        print(f'{topic}: {count} images, {mean:.1f} targets in each', file=sys.stderr)


if __name__ == '__main__':
    main()
