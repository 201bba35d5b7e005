"""What is explained of an image, whether its targets are sharp, and what a word leaves open."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.confidence import FEATURES
from ahf_ros.detectors.ring.explained import NOTHING, Explained
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.detectors.ring.other_prints import attainable_sharpness, sharpness
from ahf_ros.detectors.ring.soft import in_focus, soft_dots
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import NO_FITS, Fit

CODE = family('metashape12')


def dots(
    count: int, blur: float, radius: float = 10.0, share: float = 1.0, y: float = 50.0
) -> Fit:
    """Return dots of one blur, 100 px apart."""
    x, ones = 100.0 * np.arange(1, count + 1), np.ones(count)
    frames = frame.affine_frames(x, y * ones, radius * ones, radius * ones, 0 * ones)
    covariance = np.tile(np.eye(2), (count, 1, 1))
    polarity = ones.astype(int)
    return Fit(
        frames, polarity, ones / 4, 200 * ones, share * ones, ones / 50, covariance, blur * ones
    )


def read(fits: Fit, certain: float) -> Hypotheses:
    """Return what dots were read as, with one confidence."""
    unread = Hypotheses.unread(fits, CODE)
    count = len(fits.frames)
    return Hypotheses(
        **{
            name: getattr(unread, name)
            for name in Hypotheses.__slots__
            if name not in ('confidence', 'features')
        },
        features=np.zeros((count, FEATURES)),
        confidence=np.full(count, certain),
    )


def test_certain_targets_are_explained_with_their_bands_and_whole_dots_without() -> None:
    target = Explained.by(read(dots(1, 0.7, share=0.5), 1.0))
    dot = Explained.by(read(dots(1, 0.7), 0.0))
    assert (target.certain.tolist(), dot.certain.tolist()) == ([True], [False])
    assert np.allclose(target.sizes, 10 * (CODE.band_outer + 0.4))
    assert np.allclose(dot.sizes, 14)
    assert len(Explained.by(read(dots(1, 0.7, share=0.5), 0.0)).frames) == 0
    both = Explained.joined([NOTHING, target, dot])
    assert [len(both.outlines_in(level)) for level in (0, 3, 4, 6)] == [2, 2, 1, 0]
    assert np.allclose(both.outlines_in(0), both.outlines)


def test_small_whole_dots_do_not_hide_what_an_oblique_view_may_show() -> None:
    sizes = [Explained.by(read(dots(1, 0.7, radius), 0.0)).clear for radius in (6.0, 12.0)]
    assert np.concatenate(sizes).tolist() == [False, True]
    assert Explained.by(read(dots(1, 0.7, 6.0), 1.0)).clear.all()


@pytest.mark.parametrize(
    ('blur', 'count', 'sharp'), [(0.7, 5, True), (0.7, 4, False), (2, 5, False)]
)
def test_some_certain_targets_tell_whether_targets_are_sharp(
    blur: float, count: int, sharp: bool
) -> None:
    fits = dots(count, blur)
    assert in_focus([(fits, read(fits, 1.0))]) is sharp
    assert in_focus([]) is False


def test_soft_dots_are_spots_of_light_where_many_are_and_targets_are_sharp() -> None:
    many, sharp = dots(300, 2.0), dots(5, 0.7, y=500.0)
    unread, of_targets = (many, read(many, 0.0)), (sharp, read(sharp, 1.0))
    nothing = (NO_FITS, read(NO_FITS, 0.0))
    assert len(soft_dots([unread], NO_FITS, lambda fit: fit).frames) == 300
    assert len(soft_dots([unread, of_targets], NO_FITS, lambda fit: fit).frames) == 0
    assert len(soft_dots([of_targets], many, lambda fit: fit).frames) == 0
    assert len(soft_dots([nothing], many, lambda fit: fit).frames) == 300


def test_a_second_measurement_tells_whether_an_unlikely_dot_is_soft() -> None:
    nothing, once = (NO_FITS, read(NO_FITS, 0.0)), dots(3, 1.0)
    assert len(soft_dots([nothing], once, lambda _: dots(3, 2.0)).frames) == 3
    assert len(soft_dots([nothing], once, lambda _: dots(3, 1.0)).frames) == 0


def test_a_word_whose_edges_are_in_their_places_leaves_no_room_for_a_sharper_one() -> None:
    whole, half = dots(1, 0.7), dots(1, 0.7, share=0.5)
    assert np.allclose(attainable_sharpness(sharpness(whole), whole.share), sharpness(whole))
    assert np.allclose(attainable_sharpness(sharpness(half), half.share), sharpness(whole))
