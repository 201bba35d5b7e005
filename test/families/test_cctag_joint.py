"""The rings of CCTags and the light on them are fitted to pixels together."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.families.cctag.alignment import align
from ahf_ros.families.cctag.joint import contested, jointly
from ahf_ros.families.cctag.rings import Aligned
from ahf_ros.prints.cctag import circle_family
from ahf_ros.scenes.scene import Rendering
from ahf_ros.vision import frame
from support.scenes import counted, errors, relative_errors, rendering

FAMILY = 'cctag4'
STRIPES = {'light': 'stripe', 'ambient': 0.3}


def scene(**changes: object) -> Rendering:
    size = {'width': 640, 'height': 480, 'targets': 12, 'dot_radius': 8.0, 'seed': 2}
    return rendering(**size | {'family': FAMILY} | changes)


def rings_of(shown: Rendering) -> Aligned:
    """Return the rings of targets, without doubt, as rays find them."""
    columns = [(it.x, it.y, it.semi_major, it.semi_minor, it.angle) for it in shown.targets]
    ids = np.array([it.id for it in shown.targets])
    edges = np.tile([0.0, 0.85, 0.0], (len(ids), 1))
    frames = frame.affine_frames(*np.array(columns).T)
    rings = align(as_float(shown), frames, ids, edges, circle_family(FAMILY))
    return replace(rings, margin=np.full(len(ids), 20.0))


def as_float(shown: Rendering) -> np.ndarray:
    return shown.image.astype(np.float32)


def rms(rings: Aligned, shown: Rendering) -> float:
    places = np.array([(it.x, it.y) for it in shown.targets])
    return float(np.sqrt(((rings.frames[:, :2, 2] - places) ** 2).mean()))


def test_pixels_place_rings_better_than_rays() -> None:
    shown = scene(**STRIPES, width=800, height=600, dot_radius=12.0)
    rings = rings_of(shown)
    gray = as_float(shown)
    placed = jointly(gray, gray, rings, circle_family(FAMILY))
    assert rms(placed, shown) < 0.8 * rms(rings, shown)
    assert rms(placed, shown) < 0.01


@pytest.mark.lasting
@pytest.mark.parametrize('light', ['stripe', 'lattice'])
def test_small_targets_are_read_and_placed_under_patterns(light: str) -> None:
    shown = scene(width=560, height=420, targets=10, light=light, ambient=0.3)
    found = create_detector(family=FAMILY)(shown.image)
    assert counted(shown, found) == (10, 0, 0)
    assert np.sqrt((errors(shown, found) ** 2).mean()) < 0.02
    assert 0.2 < relative_errors(shown, found).mean() / 2 < 2


@pytest.mark.lasting
def test_wrong_readings_are_put_right_by_pixels() -> None:
    shown = scene(**STRIPES)
    right = rings_of(shown)
    ids, margin = right.ids.copy(), right.margin.copy()
    ids[0] ^= 1
    ids[1] ^= 127
    margin[:3] = 0.0
    wrong = replace(right, ids=ids, margin=margin)
    gray = as_float(shown)
    read = contested(gray, gray, wrong, 1, circle_family(FAMILY))
    assert read.ids.tolist() == right.ids.tolist()
    assert (read.confidence[:3] > 0.9).all()


@pytest.mark.lasting
def test_what_is_no_target_is_refused_by_pixels() -> None:
    shown = scene()
    dot = (60, 60)
    image = shown.image.copy()
    cv2.circle(image, dot, 7, 60, -1, cv2.LINE_AA)
    rings = rings_of(shown)
    false = replace(
        rings.select(slice(0, 1)),
        frames=frame.affine_frames(*np.array([[60.0], [60.0], [8.0], [8.0], [0.0]])),
        margin=np.array([2.0]),
    )
    every = Aligned.joined([rings, false])
    gray = image.astype(np.float32)
    read = contested(gray, gray, every, 1, circle_family(FAMILY))
    assert (read.confidence[:-1] > 0.75).all()
    assert read.confidence[-1] < 0.1


def test_few_targets_and_none_stay_as_they_are_read() -> None:
    shown = scene(targets=2)
    rings = rings_of(shown)
    family, gray = circle_family(FAMILY), as_float(shown)
    read = contested(gray, gray, rings, 1, family)
    assert read.ids.tolist() == rings.ids.tolist()
    assert not read.by_pixels.any()
    none = rings.select(np.zeros(0, int))
    assert len(contested(gray, gray, none, 1, family).ids) == 0
    assert len(jointly(gray, gray, none, family).ids) == 0


@pytest.mark.lasting
@pytest.mark.parametrize('gain', [0.15, 1.0])
@pytest.mark.parametrize('amount', [0.0, 0.7])
def test_dark_and_sharpened_images_are_explained(gain: float, amount: float) -> None:
    shown = scene(dot_radius=12.0, targets=5)
    values = as_float(shown)
    values += amount * (values - cv2.GaussianBlur(values, (0, 0), 1.5))
    image = np.clip(gain * values, 0, 255).round().astype(np.uint8)
    found = create_detector(family=FAMILY)(image)
    assert counted(shown, found) == (5, 0, 0)
    assert np.sqrt((errors(shown, found) ** 2).mean()) < (0.02 if gain == 1.0 else 0.03)


@pytest.mark.lasting
@pytest.mark.parametrize('radius', [15.0, 60.0])
def test_drawings_are_read(radius: float) -> None:
    ids, fine = [0, 42, 85, 127], 8
    family = circle_family(FAMILY)
    x = (np.arange(4 * fine * round(3 * radius)) + 0.5) / fine - 0.5
    y = x[: len(x) // 4, None]
    white = np.ones((len(y), len(x)), bool)
    centres = 1.5 * radius + 3 * radius * np.arange(4) - 0.3
    for centre, radii in zip(centres, family.radii(np.array(ids)), strict=True):
        away = np.hypot(x - centre, y - centres[0]) / radius
        for circle in radii:
            white ^= away < circle
    size = len(x) // fine, len(y) // fine
    image = cv2.resize(255 * white.astype(np.uint8), size, interpolation=cv2.INTER_AREA)
    found = create_detector(family=FAMILY)(image)
    assert [it.id for it in found] == ids
    assert [it.x for it in found] == pytest.approx(centres.tolist(), abs=0.05)
