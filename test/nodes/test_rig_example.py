"""The example of a rig in docs/examples, with the answers to rendered images of two cameras."""

import csv
import runpy

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import rclpy
from std_msgs.msg import Header

from ahf_ros import SceneSettings, identify, msg, render
from ahf_ros.files.target_messages import coded_target_array
from support import ROOT
from support.live import Graph

SCENE = SceneSettings(width=480, height=360, targets=4, dot_radius=12.0, light='stripe', seed=1)


def test_what_both_cameras_see_is_paired(graph: Graph, capsys: pytest.CaptureFixture) -> None:
    image = render(SCENE).image
    views = {'left': image, 'right': image[:, : SCENE.width // 2]}  # sees a part of the targets
    found = {name: identify(view) for name, view in views.items()}
    rig = runpy.run_path(str(ROOT / 'docs' / 'examples' / 'rig.py'))['Rig'](list(views))
    try:
        # Stamps 1 and 3 have an answer of one camera only.
        for name, stamps in (('left', (1, 2, 4)), ('right', (2, 3, 4))):
            sent = graph.publisher(msg.CodedTargetArray, f'/{name}/coded_targets')
            for stamp in stamps:
                header = Header()
                header.stamp.sec = stamp
                shape = views[name].shape
                sent.publish(coded_target_array(found[name], 'metashape12', shape, header, msg))
        printed: list[str] = []

        def complete() -> bool:
            rclpy.spin_once(rig, timeout_sec=0)
            printed.append(capsys.readouterr().out)
            return ''.join(printed).count('\n4.') == len(found['right'].targets)

        graph.until(complete)
    finally:
        rig.destroy_node()
    rows = list(csv.DictReader(''.join(printed).splitlines()))
    assert 0 < len(found['right'].targets) < len(found['left'].targets)
    expected = [(f'{stamp}.000000000', it.id) for stamp in (2, 4) for it in found['right'].targets]
    assert [(row['stamp'], int(row['id'])) for row in rows] == expected
    for row, target in zip(rows, found['right'].targets * 2, strict=True):
        assert float(row['right_x']) == pytest.approx(target.x, abs=1e-3)
        assert float(row['left_x']) == pytest.approx(target.x, abs=0.1)
