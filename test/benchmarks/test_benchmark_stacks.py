"""The benchmark of stacks on a small scene."""

import json
from pathlib import Path

from benchmarks import stacks

SMALL = '--lights stripe --radii 12 --targets 3 --width 400 --height 300 --seeds 1'


def test_a_stack_is_compared_with_one_image_and_with_normal_light(tmp_path: Path) -> None:
    assert stacks.main([*SMALL.split(), '--output', str(tmp_path / 'stacks')]) == 0
    (row,) = json.loads((tmp_path / 'stacks.json').read_text())['rows']
    assert (row['parts'], row['stack']['right'], row['stack']['expected']) == (1, 3, 3)
    assert row['normal light']['right'] == 3
    assert row['first image']['right'] <= 3
    assert (tmp_path / 'stacks.md').read_text().count('3 / 0 / 0') >= 2
