"""What is known of an image while its targets are read: dots, growth, and IDs that are there."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ahf_ros import create_identifier
from ahf_ros.base.target import Target
from ahf_ros.families import Expecting, create_detector
from ahf_ros.families.external.guarded import guarded
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import NOTHING_KNOWN, Explained, Prior
from ahf_ros.prints.ring import family
from ahf_ros.scenes.evaluation import RIGHT, WRONG, judge
from ahf_ros.vision import frame
from ahf_ros.vision.pyramid import Octave, image_pyramid, octaves
from support.drawn_dots import drawn, in_stripes
from support.pictures import occluders
from support.pictures.disturbed import far_apart
from support.pictures.exposure import Exposure
from support.pictures.sheets import target_sheet
from support.ring import made_up

CODE = family('metashape12')


def read(certain: bool, share: float = 1.0) -> Hypotheses:
    """Return a dot of 10 px, and that its word is certain or not."""
    dot = Hypotheses.unread(made_up([100.0], share), CODE)
    return replace(dot, confidence=np.ones(1) * certain)


def test_certain_targets_are_explained_with_their_bands_and_whole_dots_without() -> None:
    target = Explained.by(read(True, share=0.5))
    dot = Explained.by(read(False))
    assert (target.certain.tolist(), dot.certain.tolist()) == ([True], [False])
    assert np.allclose(target.sizes, 10 * (CODE.band_outer + 0.45))
    assert np.allclose(dot.sizes, 12.5)
    assert len(Explained.by(read(False, share=0.5)).frames) == 0
    both = Explained.joined([target, dot])
    assert [len(both.outlines_in(level)) for level in (0, 3, 4, 6)] == [2, 2, 1, 0]
    assert np.allclose(both.outlines_in(0), both.outlines)


def test_few_certain_targets_tell_nothing_but_which_ids_are_expected() -> None:
    assert Prior.after(frozenset(), np.array([0.8, 0.8])) == NOTHING_KNOWN
    assert Prior.after(frozenset({7}), np.zeros(0)) == Prior(frozenset({7}))


def test_the_shift_of_certain_targets_is_probably_that_of_the_others() -> None:
    alike = Prior.after(frozenset(), np.array([0.8, 0.82, 0.78, 0.8, 5.0]))
    assert alike.shift == pytest.approx(0.8)
    assert alike.deviation < NOTHING_KNOWN.deviation
    apart = Prior.after(frozenset(), np.array([-1.5, -0.5, 0.4, 1.6]))
    assert apart.deviation == NOTHING_KNOWN.deviation
    assert apart.deviation > alike.deviation > 0  # not all are lit and printed alike


def certain_ones(polarity: int = 1, count: int = 4) -> Explained:
    """Return certain targets in a row, with dots of 10 px and 7 px, which have grown by 0.5 px."""
    dots = made_up([100.0 * number for number in range(1, count + 1)])
    stretched = frame.affine_frames(dots.frames[:, 0, 2], 50.0, 10.0, 7.0, 0.6)
    shifts = np.full(count, 0.5)
    dots = replace(
        dots, frames=stretched, edge_shift=polarity * shifts, polarity=np.full(count, polarity)
    )
    return Explained.by(replace(Hypotheses.unread(dots, CODE), confidence=np.ones(count)))


PLACES = [(130.0, 150.0), (290.0, 190.0)]


def oblique_dots(paper: int, ink: int) -> Octave:
    """Return an octave with dots under stripes, which have grown as `certain_ones` have."""
    grown = 1 + 0.5 / np.sqrt(70)
    dots = [(x, y, 10 * grown, 7 * grown, 0.6) for x, y in PLACES]
    image = in_stripes(drawn(dots, paper, ink, (240, 420)), 24, 0.4)
    return next(octaves(image_pyramid(image, 90.0), 4.0, 90.0))


@pytest.mark.parametrize('polarity', [1, -1])
def test_dots_in_the_shape_of_the_targets_about_them_are_found(polarity: int) -> None:
    others = replace(certain_ones(polarity), shifts=np.full(4, 0.5 * polarity))
    alike = others.alike(oblique_dots(*((200, 30) if polarity > 0 else (30, 200))))
    away = np.hypot(*(alike.frames[:, None, :2, 2] - PLACES).transpose(2, 0, 1))
    best = away.argmin(axis=0)
    assert (away.min(axis=0) < 1.5).all()
    assert (alike.share[best] >= np.sort(alike.share)[-2]).all()  # nothing has more votes
    grown = 1 + 0.5 / np.sqrt(70)
    axes = np.array(frame.ellipse_axes(alike.frames[best]))
    assert np.tile([10 * grown, 7 * grown, 0.6], (2, 1)) == pytest.approx(axes.T, rel=1e-5)


def test_dots_of_another_colour_or_size_of_octave_and_two_targets_show_no_shape() -> None:
    octave = oblique_dots(200, 30)
    assert not len(certain_ones(-1).alike(octave).frames)
    assert not len(certain_ones(count=2).alike(octave).frames)
    large = replace(octave, radii=(20.0, 90.0))
    assert not len(certain_ones().alike(large).frames)


IDS = far_apart(CODE, 3, 31)
IMAGE = np.zeros((8, 8), np.uint8)
PAPER_ON_PAPER = Exposure(occluder=occluders.over_sectors(2, 220.0, whole=True))


def kinds(targets: Any, truth: Any) -> list[str]:
    """Return which reports are right, wrong and false."""
    return [verdict.kind for verdict in judge(truth, targets)]


@pytest.fixture(scope='module')
def covered() -> Any:
    """Return photographs of targets under paper, their truth, and what is read without IDs."""
    sheets = [target_sheet(CODE.name, IDS, seed) for seed in (31, 32, 33)]
    shown = [(sheet.photograph(PAPER_ON_PAPER), sheet.truth) for sheet in sheets]
    blind = create_detector('ring', family='metashape12')
    return [(image, truth, kinds(blind(image), truth)) for image, truth in shown]


def test_no_two_ids_chosen_far_apart_look_alike_where_sectors_are_covered() -> None:
    assert len(IDS) > 5
    looks = {}
    for number in IDS:
        word = int(CODE.words[number - 1])
        for start in range(CODE.bits):
            window = sum(1 << (start + step) % CODE.bits for step in range(3))
            look = CODE.number(word & ~window)
            assert look is None or look not in looks or looks[look] == number
            looks[look] = number


@pytest.mark.lasting
def test_paper_on_paper_turns_one_id_into_another_unless_they_are_known(covered: Any) -> None:
    assert any(WRONG in blind for _, _, blind in covered)  # no trace is left to see
    informed = create_detector('ring', family='metashape12').expecting(frozenset(IDS))
    read = [kind for image, truth, _ in covered for kind in kinds(informed(image), truth)]
    assert set(read) == {RIGHT}


@pytest.mark.parametrize('name', ['expected_ids', 'network_ids'])
def test_ids_that_are_given_reach_the_detector(covered: Any, name: str) -> None:
    image, truth = next((image, truth) for image, truth, blind in covered if WRONG in blind)
    given = {name: ','.join(map(str, IDS))}
    identifier = create_identifier(family='metashape12', ahf=False, **given)
    assert WRONG not in kinds(identifier.identify(image).targets, truth)


def test_ids_that_are_not_expected_are_never_read_as_expected_ones() -> None:
    sheet = target_sheet(CODE.name, IDS, 31)
    others = frozenset(range(1, len(CODE.words) + 1)) - frozenset(IDS)
    detector = create_detector('ring', family='metashape12')
    assert isinstance(detector, Expecting)
    read = kinds(detector.expecting(others)(sheet.photograph(Exposure())), sheet.truth)
    assert read.count(RIGHT) == len(read) > 0


class Plugin:
    """A detector of another package that is told which IDs are expected."""

    name, family = 'mine', 'metashape12'

    def __init__(self, ids: Iterable[int] = ()) -> None:
        self.ids = ids

    def __call__(self, image: np.ndarray) -> list[Target]:
        return [Target(number, 1, 4.0, 4.0, 2.0, 2.0) for number in sorted(self.ids)]

    def expecting(self, ids: list[int]) -> Any:
        if 13 in ids:
            raise RuntimeError('not that one')
        return Plugin(ids)


def test_a_detector_of_another_package_is_told_the_ids() -> None:
    detector = guarded(Plugin(), 5.0)
    assert [it.id for it in detector.expecting(frozenset({7, 3}))(IMAGE)] == [3, 7]
    assert detector(IMAGE) == []
    with pytest.raises(ValueError, match=r"detector 'mine' failed.*not that one"):
        detector.expecting(frozenset({13}))
