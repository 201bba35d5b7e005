"""The benchmark of rings of dots prints wrong IDs and false positives, and draws what it says."""

from __future__ import annotations

import numpy as np

from benchmarks import dots
from benchmarks.textures import SIZE, lookalikes, textured_image


def test_every_cell_has_right_wrong_and_false() -> None:
    figures = {'right': 29, 'wrong': 1, 'false_positives': 2, 'rmse_xy': 0.0123}
    row = {'group': 'light', 'name': 'stripe 0.3', 'expected': 30, 'nees': 2.04, 'seconds': 0.5}
    records = [{**row, **figures, 'detector': name, 'ahf': ahf} for name, ahf in dots.METHODS]
    head, rule, line = dots.scene_table(records)
    assert head.count('|') == rule.count('|') == line.count('|')
    assert line.startswith('| light | stripe 0.3 | 30 | 29, 1 wrong, 2 false (0.012) |')
    assert line.endswith('| 2.0 | 0.50 |')


def test_scenes_have_all_that_the_figures_ask_for() -> None:
    names = {(group, name) for group, name, _ in dots.scenes()}
    assert {('width', f'{width} px') for width in (24, 29, 36, 48, 60, 90)} < names
    lights = {f'{light} {ambient}' for light in ('stripe', 'lattice') for ambient in (0.3, 0.12)}
    assert {('light', name) for name in lights} < names


def test_textures_follow_from_their_seed() -> None:
    for image in (textured_image, lookalikes):
        first, again, other = image(5), image(5), image(6)
        assert first.shape == SIZE[::-1]
        assert np.array_equal(first, again) and not np.array_equal(first, other)
        assert first.std() > 5
