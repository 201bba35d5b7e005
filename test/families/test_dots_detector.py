"""Rings of dots are identified, and nothing else is."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, DottedTarget
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.dots.detector import find_rings
from ahf_ros.families.dots.discs import open_regions
from ahf_ros.families.dots.rings import CERTAIN, WEIGHTS
from ahf_ros.prints.dots import DOTS_DESIGN, dot_family
from ahf_ros.scenes.scene import Rendering
from ahf_ros.vision.frame import ellipse_axes
from ahf_ros.vision.pyramid import image_pyramid
from support.scenes import counted, rendering

SIZE = {'family': 'dots', 'width': 800, 'height': 600, 'targets': 6, 'dot_radius': 10.0, 'seed': 4}
detect = create_detector(family='dots')


def scene(**changes: object) -> Rendering:
    return rendering(**SIZE | changes)


def design(folder: Path, pixels: float, shift: float, radius: float) -> tuple[str, float]:
    """Return a data file of dark targets whose edges moved, and the radius of the disc, px."""
    made = json.loads(DOTS_DESIGN.read_text())
    grown, scale = shift / pixels, 1 + shift / pixels
    made['dot_circle'] /= scale
    made['dot_radius'] = (radius + grown) / scale
    made['ground_radius'] = (made['ground_radius'] - grown) / scale
    made['border_radius'] = (made['border_radius'] + grown) / scale
    path = folder / 'grown.json'
    path.write_text(json.dumps(made))
    return str(path), scale * pixels


@pytest.mark.parametrize('light', ['normal', 'stripe'])
@pytest.mark.parametrize(
    ('shift', 'radius'), [(-1, 0.32), (-0.6, 0.32), (0.6, 0.32), (1, 0.32), (0, 0.2), (0, 0.45)]
)
def test_edges_that_moved_and_dots_of_other_radii_are_read(
    tmp_path: Path, light: str, shift: float, radius: float
) -> None:
    path, pixels = design(tmp_path, 14.0, shift, radius)
    own = {'family_file': path, 'dot_radius': pixels, 'radius_spread': 0.0}
    shown = scene(**own, light=light, seed=6)
    found = find_rings(
        image_pyramid(shown.image, 60.0), DetectorSettings(family='dots'), dot_family()
    )
    certain = found.select(found.of_word >= CERTAIN)
    assert set(dot_family().ids(certain.words)) == {target.id for target in shown.targets}
    assert certain.edge_shift == pytest.approx(np.full(len(certain.words), shift), abs=0.1)
    assert certain.radius == pytest.approx(
        np.full(len(certain.words), radius + shift / 14), rel=0.25
    )
    assert ellipse_axes(certain.frames)[0] == pytest.approx(14.0, rel=0.01)
    reported = detect(shown.image)
    assert counted(shown, reported) == (6, 0, 0)
    assert all(target.edge_shift == pytest.approx(shift, abs=0.1) for target in reported)


def test_a_target_and_its_mirror_image_are_one_code() -> None:
    shown = scene()
    found = detect(np.ascontiguousarray(shown.image[:, ::-1]))
    assert [target.id for target in found] == [target.id for target in shown.targets]


@pytest.mark.parametrize(
    ('name', 'light'), [('dots', 'normal'), ('dots', 'stripe'), ('dots_published', 'normal')]
)
def test_marks_that_are_no_targets_are_not_reported(name: str, light: str) -> None:
    shown = scene(targets=0, distractors=25, light=light)
    assert create_detector(name, family='dots')(shown.image) == []


def test_rings_without_a_code_are_reported_on_request() -> None:
    shown = scene(targets=1)
    (target,) = shown.targets
    family = dot_family()
    image = shown.image.astype(float)
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    distance = np.hypot(x - target.x, y - target.y) / target.semi_major
    ring = np.abs(distance - family.dot_circle) < 1.6 * family.dot_radius
    image[ring] = np.percentile(image[ring], 95)
    blank = image.astype(np.uint8)
    assert detect(blank) == []
    (found,) = create_detector(family='dots', report_undecoded=True)(blank)
    assert (found.id, found.code, found.confidence) == (UNDECODED, 0, 0.0)
    assert (found.x, found.y) == pytest.approx((target.x, target.y), abs=0.05)


def test_disc_border_and_dots_come_with_every_target() -> None:
    shown = scene(dot_radius=14.0, targets=4)
    family = dot_family()
    for target in detect(shown.image):
        assert isinstance(target, DottedTarget)
        assert (target.template_dots, target.polarity) == (2, 1)
        assert len(target.dots) == 2 + bin(target.code).count('1')
        (x, y, radius, *_), border = target.dots[:2]
        assert (x, y, radius) == (target.x, target.y, target.semi_major)
        assert border[2] == pytest.approx(family.border_radius * radius, rel=0.01)
        ground = np.median(shown.image)
        for x, y, *_ in target.dots[2:]:
            assert shown.image[round(y), round(x)] < 0.6 * ground


def test_every_weight_has_its_feature_and_says_what_made_it() -> None:
    made = json.loads(WEIGHTS.read_text(encoding='utf-8'))['dots_confidence']
    assert (len(made['target']), len(made['word'])) == (4, 5)
    seeds = ' '.join(map(str, made['seeds']))
    assert made['command'] == f'python -m benchmarks.confidence --family dots --fit {seeds}'
    assert max(made['seeds']) < 101  # those from 101 on are for tests
    assert made['commit']


def test_only_edges_that_nothing_explains_open_a_region() -> None:
    image = np.full((600, 800), 200, np.uint8)
    image[:, 700:] = 60
    cv2.circle(image, (150, 200), 20, 40, -1, cv2.LINE_AA)
    edges = image_pyramid(image, 60.0).edges[0]
    (region,) = open_regions(edges, np.zeros((0, 4, 2)))
    rows, columns = region
    assert rows.start <= 90 and rows.stop >= 110 and columns.start <= 65 and columns.stop >= 85
    assert columns.stop < 350
    known = 75 + np.array([[(-30.0, -5.0), (30.0, -5.0), (30.0, 55.0), (-30.0, 55.0)]])
    assert open_regions(edges, known) == []
