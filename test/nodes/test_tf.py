"""The tree of frames that a node adds to."""

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from ahf_ros.nodes.tf import Parents


@pytest.mark.parametrize(
    ('parent', 'child', 'words'),
    [
        ('camera', 'targets', ''),
        ('targets', 'camera', "'camera' has the parent 'link' already, accepted is one parent"),
        ('link', 'camera', ''),
        ('camera', 'map', "'map' is an ancestor of 'camera' already, accepted is no loop"),
        ('camera', 'camera', "'camera' is the frame of both camera and targets, accepted are two"),
        ('', 'targets', 'the images have no frame_id, accepted is the frame of the camera'),
    ],
)
def test_a_frame_has_one_parent_and_no_loop(parent: str, child: str, words: str) -> None:
    parents = Parents()
    for above, below in (('map', 'base'), ('/base', 'link'), ('link', '/camera')):
        parents.add(above, below)
    refusal = parents.refusal(parent, child)
    assert refusal.startswith(words)
    assert bool(refusal) == bool(words)
