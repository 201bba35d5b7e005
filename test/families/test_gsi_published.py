"""The published method for GSI's targets: how it decodes points."""

import numpy as np
import pytest

from ahf_ros.base.target import DottedTarget
from ahf_ros.families import create_detector
from ahf_ros.families.published.gsi import decode
from ahf_ros.prints.gsi import point_family
from support.scenes import rendering

GSI = point_family()
SIZE = {'family': 'gsi', 'width': 1000, 'height': 700, 'targets': 4, 'dot_radius': 6.0, 'seed': 3}

# Table 3, px; A is printed as (2047.00, 1072.58), where two digits changed places.
TABLE_3 = [
    (2407.00, 1072.58),
    (2326.77, 1133.63),
    (2331.21, 1170.83),
    (2368.04, 1166.33),
    (2364.86, 1127.35),
    (2333.77, 1081.33),
    (2370.47, 1076.75),
    (2401.81, 1110.59),
]


def test_the_worked_example_is_code_18_and_not_its_mirror_image() -> None:
    decoded = decode(np.array(TABLE_3), GSI)
    assert [GSI.number(int(word)) for word in decoded.words] == [18]
    # B and D of Table 3 are exchanged: in the image y goes down.
    assert decoded.members.tolist() == [[0, 3, 2, 1, 4, *decoded.members[0, 5:].tolist()]]
    assert decoded.bias[0] == pytest.approx(0.102, abs=2e-3)  # of III, Table 5: 0.054 and 0.086
    mirrored = decode(np.array(TABLE_3) * [-1, 1], GSI)
    assert 18 not in [GSI.number(int(word)) for word in mirrored.words]


def test_too_few_points_are_no_target() -> None:
    assert not len(decode(np.array(TABLE_3)[:7], GSI).words)
    assert not len(decode(np.zeros((0, 2)), GSI).words)


def test_dots_of_a_target_come_with_it() -> None:
    found = create_detector('gsi_published', family='gsi')(rendering(**SIZE).image)
    assert found
    for target in found:
        assert isinstance(target, DottedTarget)
        assert (len(target.dots), target.template_dots) == (8, 5)
        assert target.dots[GSI.reference][:2] == (target.x, target.y)
