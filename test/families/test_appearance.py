"""Targets look like the print of their words; other prints do not, nearly all round."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.families import DetectorSettings
from ahf_ros.families.ring.appearance import unlike_print
from ahf_ros.families.ring.confidence import COVERED
from ahf_ros.families.ring.decoding import Words
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.families.ring.polar import polar_images
from ahf_ros.prints.ring import family
from ahf_ros.scenes.covers import Cover, ink_cover
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.frame import ellipse_axes
from support.pictures import occluders
from support.pictures.disturbed import Targets
from support.pictures.exposure import Exposure
from support.pictures.lookalikes import LOOKALIKES
from support.pictures.sheets import mark_sheet
from support.ring import made_up

LEAST = 6.0
"""Semi-minor axis of dots, px, less than those of the sheets and scenes."""

SOFT = 0.35  # deviation of half of the blur of soft ink, dot radii
FALL = 1.1  # of ln of light across a target and its ground
SETTINGS = DetectorSettings(family='metashape12')


def unlike(image: np.ndarray, name: str) -> np.ndarray:
    """Return the shares of sectors of the dots that were read; parts of marks are no dots.

    They are 0 where light is uneven.
    """
    found = find_hypotheses(image, DetectorSettings(family=name))
    dots = ellipse_axes(found.frames)[1] > LEAST
    return np.nan_to_num(found.unlike[dots & (found.words > 0)])


@pytest.mark.parametrize('name', ['metashape12', 'aicon14'])
def test_targets_look_like_their_words(name: str) -> None:
    (sheet,) = Targets(name, 12, 3).sheets()
    clear = unlike(sheet.photograph(Exposure()), name)
    assert len(clear) == 12 and not clear.any()
    spots = Exposure(occluder=occluders.disc(0.8, 150.0))
    spotted = unlike(sheet.photograph(spots), name)
    assert 0 < spotted.max() < COVERED  # measured: 0.1 in the median


def test_scratches_are_no_circles_of_another_print() -> None:
    (sheet,) = Targets('metashape12', 12, 3).sheets()
    dirt = occluders.scratches(6, (1 / 12, 3 / 12))
    scratched = unlike(sheet.photograph(Exposure(occluder=dirt)), 'metashape12')
    assert len(scratched) >= 12  # a dot may be read twice
    assert np.median(scratched) < COVERED / 2  # measured: 0; 0.4 where radii do not count


def test_other_prints_are_others_all_round() -> None:
    generator = np.random.default_rng(5)
    inks = [LOOKALIKES['two bands (RAD)'](family('aicon12'), generator) for _ in range(36)]
    found = unlike(mark_sheet(inks, 5).photograph(Exposure()), 'aicon12')
    assert len(found) > 12
    assert np.median(found) > COVERED


def test_a_rim_between_all_marks_is_of_another_print() -> None:
    code = family('metashape12')
    rim = replace(code, band_inner=2.0, band_outer=2.2)

    def ink(turn: float) -> Cover:
        marks, round_them = (
            ink_cover(code.ink(code.word(146), 0.05), turn),
            ink_cover(rim.ink(4095, 0.05), turn),
        )
        return lambda *place: np.maximum(marks(*place), round_them(*place))

    found = unlike(mark_sheet([ink] * 9, 5).photograph(Exposure()), code.name)
    assert len(found) >= 6
    assert np.median(found) > COVERED


def test_light_that_ends_between_dot_and_band_tells_nothing() -> None:
    (sheet,) = Targets('metashape12', 12, 3).sheets()
    image = sheet.photograph(Exposure())
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    away = np.min([np.hypot(x - of.x, y - of.y) for of in sheet.truth], axis=0)
    lit = np.where(away < 1.6 * sheet.radius, image, 0.3 * image).astype(np.uint8)
    found = find_hypotheses(lit, DetectorSettings(family='metashape12'))
    assert len(found.words) and np.isnan(found.unlike[found.words > 0]).all()


def test_blur_that_leaves_no_ground_tells_nothing() -> None:
    code, gray = family('metashape12'), np.full((60, 60), 200, np.float32)
    polar = polar_images(gray, made_up([30.0], radius=2.0), code.band, 120)
    words = replace(Words.none(1, 120), words=np.array([71]))
    soft = replace(polar, blur=np.array([3.0]))
    assert np.isnan(unlike_print(soft, words, np.zeros(1), np.zeros(1), code)).all()


def test_light_that_is_uneven_tells_nothing() -> None:
    scene = SceneSettings(width=800, height=600, targets=4, light='stripe', ambient=0.12, seed=2)
    found = find_hypotheses(render(scene).image, DetectorSettings(family=scene.family))
    told = found.unlike[found.words > 0]
    assert len(told) >= 4 and np.isnan(told).all()


def test_a_lamp_nearby_leaves_print_to_look_at() -> None:
    """Light falls off across a target, to a third, and the edges of ink are soft."""
    (sheet,) = Targets('metashape12', 6, 3).sheets()
    image = sheet.photograph(Exposure()).astype(np.float32)
    image = (image + cv2.GaussianBlur(image, (0, 0), SOFT * sheet.radius)) / 2
    half = round(5 * sheet.radius)
    for target in sheet.truth:
        x, y = round(target.x), round(target.y)
        part = image[max(y - half, 0) : y + half, max(x - half, 0) : x + half]
        near = np.exp(np.linspace(0, -FALL, part.shape[1]))
        found = find_hypotheses((part * near).astype(np.uint8), SETTINGS)
        told = found.unlike[found.words > 0]
        assert np.nanmin(told) < 0.05  # all were NaN
