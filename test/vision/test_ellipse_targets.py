"""Targets made from frames."""

import math
from dataclasses import asdict

import numpy as np

from ahf_ros.base.target import UNDECODED, UndecodedTarget
from ahf_ros.vision.ellipse_targets import ellipse_fields, targets_from_frames

FRAMES = np.array([[[4.0, 0, 10], [0, 3, 20], [0, 0, 1]], [[5.0, 0, 30], [0, 5, 40], [0, 0, 1]]])
COVARIANCE = np.tile(np.eye(2) * 0.01, (2, 1, 1))


def test_edge_shifts_that_were_not_measured_are_unknown() -> None:
    ids, codes, confidence = np.array([7, UNDECODED]), np.array([19, 23]), np.array([0.9, 0.1])
    arguments = FRAMES, COVARIANCE, ids, codes, confidence, 'aicon14'
    measured = targets_from_frames(*arguments, np.array([-0.5, math.nan]))
    assert [it.edge_shift for it in measured] == [-0.5, None]
    assert [it.edge_shift for it in targets_from_frames(*arguments)] == [None, None]
    assert (measured[0].id, measured[0].x, measured[0].semi_minor) == (7, 10.0, 3.0)
    assert measured[1] == targets_from_frames(*arguments)[1]


def test_the_fields_are_those_of_targets_of_other_kinds_as_well() -> None:
    (fields, _) = ellipse_fields(FRAMES, COVARIANCE, np.array([0.25, 0.5]))
    target = UndecodedTarget(id=UNDECODED, code=0, **fields, reason='unread')
    assert (target.edge_shift, target.covariance) == (0.25, (0.01, 0.0, 0.0, 0.01))
    assert UndecodedTarget(**asdict(target)) == target
