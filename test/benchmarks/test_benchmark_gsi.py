"""The benchmark of point-distributed targets prints both detectors beside each other."""

from dataclasses import replace

import cv2
import numpy as np

from benchmarks import gsi
from benchmarks.rows import measured, rendered
from support.pictures.textures import dot_grid

SMALL = replace(gsi.LARGE, width=700, height=500, targets=2, dot_radius=6.0)


def test_every_row_has_the_figures_of_both_detectors() -> None:
    (by_method,) = measured([rendered('views', 'two targets', SMALL)], [1], gsi.METHODS)
    assert list(by_method) == ['gsi', 'gsi_published']
    for row in by_method.values():
        figures = row.record()
        assert (figures['right'], figures['wrong'], figures['false_positives']) == (2, 0, 0)
    head, rule, line = gsi.markdown({name: [row] for name, row in by_method.items()}).splitlines()
    assert head.count('|') == rule.count('|') == line.count('|')
    assert line.startswith('| two targets | 2 of 2 | 0 | 0 | 0.0')


def test_the_grid_has_all_of_its_dots_in_the_image() -> None:
    image = dot_grid(5)
    assert image.shape == (2656, 3984)
    assert np.array_equal(image, dot_grid(5))
    count, _ = cv2.connectedComponents((image < 128).astype(np.uint8))
    assert count - 1 == 2000
