"""The comparison of `auto` with families that are named."""

import json
from pathlib import Path

from ahf_ros.base.target import TrueTarget
from benchmarks.auto import farthest, main


def test_targets_are_compared_by_their_ids() -> None:
    named = [TrueTarget(1, 10, 10), TrueTarget(2, 50, 10)]
    found = [TrueTarget(2, 53, 14), TrueTarget(3, 90, 10)]
    assert farthest(named, found) == 5
    assert farthest(named, []) == 0


def test_a_family_is_the_same_as_auto(tmp_path: Path) -> None:
    file = tmp_path / 'auto.json'
    options = ['--seeds', '7', '--families', 'aicon12', '--lights', 'normal', '--targets', '4']
    assert main([*options, '--json', str(file)]) == 0
    (row,) = json.loads(file.read_text())['rows']
    assert row['named'] == row['auto'] == [4, 0, 0]
