"""What steps and levels say of paper and ink, on polar images that are written down."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.families.ring.likelihood import (
    SHARES,
    Evidence,
    band_edges,
    edge_evidence,
    level_evidence,
    weights,
)
from ahf_ros.families.ring.polar import PolarImages
from ahf_ros.vision.image import SATURATED

BAND = (2.25, 3.5)
ANGLES, CIRCLES, OUTERMOST = 60, 200, BAND[1] + 0.95
RADII = np.linspace(0.3, OUTERMOST, CIRCLES)
MARKED = np.arange(ANGLES) // 10 % 2 == 0
ONE, NONE = np.ones(1), np.zeros(1)


def edges(of: PolarImages) -> Evidence:
    return edge_evidence(of, ONE, NONE, BAND, SHARES)


def inside(low: float, high: float) -> np.ndarray:
    """Return which circles are between two radii."""
    return np.abs(RADII - (low + high) / 2) < (high - low) / 2


def polar(
    light: float | np.ndarray = 200.0,
    polarity: int = 1,
    contrast: float = 0.25,
    growth: float = 0.0,
    radius: float = 1.0,
    size: float = 10.0,
    shade: float = 0.0,
    glare: float = SATURATED,
) -> PolarImages:
    """Return the polar image of a target of light (m,) whose marks have grown."""
    inner, outer = band_edges(np.array([radius]), np.array([growth]), BAND)
    inked = inside(0, radius + growth) | (MARKED[:, None] & inside(inner[0], outer[0]))
    dark = inked == (polarity > 0)
    lit = np.broadcast_to(np.asarray(light, float), ANGLES)[:, None]
    return PolarImages(
        gray=np.where(dark, contrast * lit, lit).T.astype(np.float32)[None],
        row=np.zeros(1, int),
        reach=np.full((1, ANGLES), np.inf),
        outermost=np.array([OUTERMOST]),
        polarity=np.array([polarity]),
        contrast=np.array([contrast]),
        lift=np.zeros(1),
        size=np.array([size]),
        noise=np.array([1.2]),
        blur=np.array([0.7]),
        plate=np.full((1, ANGLES), np.inf),
        shade=np.array([shade], np.float32),
        glare=np.array([glare], np.float32),
        brightest=np.zeros(1),
    )


def split(image: PolarImages, radius: float = 1.0, growth: float = 0.0) -> np.ndarray:
    """Return the least evidence for what is there over what is not, of a reading."""
    evidence = edge_evidence(image, np.array([radius]), np.array([growth]), BAND)
    odds = np.where(MARKED, 1, -1) * (evidence.ink - evidence.paper).sum(axis=1)
    return odds.min() / evidence.weight[0]


@pytest.mark.parametrize('polarity', [1, -1])
@pytest.mark.parametrize('light', [220.0, 80.0, 40.0])
def test_steps_tell_ink_from_paper_in_light_and_in_shadow(light: float, polarity: int) -> None:
    assert split(polar(light, polarity)) > 3


def test_light_that_changes_along_the_band_changes_no_step() -> None:
    stripes = np.where(np.arange(ANGLES) // 7 % 2, 200.0, 40.0)
    assert split(polar(stripes)) == pytest.approx(split(polar(40.0)))


def test_an_edge_is_read_where_ink_has_grown_to() -> None:
    grown = polar(growth=0.28)
    assert split(grown, growth=0.28) == pytest.approx(split(polar()), abs=0.5)
    assert split(grown) < 1


def test_bands_grow_on_both_sides() -> None:
    inner, outer = band_edges(np.array([1.0, 0.9]), np.array([0.0, 0.1]), BAND)
    assert inner == pytest.approx([2.25, 1.925])
    assert outer == pytest.approx([3.5, 3.25])


def test_what_is_neither_paper_nor_ink_speaks_against_both() -> None:
    between = polar()
    between.gray[:, inside(*BAND), :20] = 110.0
    evidence = edges(between)
    assert (np.maximum(evidence.paper, evidence.ink)[..., :20] < 0).all()


def test_the_halves_of_a_band_are_seen_apart() -> None:
    half = polar()
    half.gray[:, inside(3, BAND[1]), :10] = 110.0  # only the outer edge
    whole, seen = map(edges, (polar(), half))
    assert seen.ink[0, 0] == pytest.approx(whole.ink[0, 0])
    assert (seen.ink[0, 1, :10] < 0).all()
    assert seen.ink[0, 1, 10:] == pytest.approx(whole.ink[0, 1, 10:])


def test_angles_that_the_image_does_not_show_say_nothing() -> None:
    reach = np.full((1, ANGLES), np.inf)
    reach[:, 5:25] = BAND[0]
    evidence = edges(replace(polar(), reach=reach))
    assert not evidence.paper[..., 5:25].any()
    assert not evidence.ink[..., 5:25].any()
    assert evidence.paper[..., 25:].all()


def test_white_bands_under_glare_say_nothing_but_over_exposed_paper_does() -> None:
    glare, white = polar(), polar(light=255.0, glare=np.inf)
    glare.gray[..., :20] = 255.0
    of_glare, of_white = map(edges, (glare, white))
    assert not of_glare.paper[..., :20].any()
    assert not of_glare.ink[..., :20].any()
    assert of_white.paper[..., ~MARKED].min() > 0
    assert of_white.ink[..., MARKED].min() > 0


@pytest.mark.parametrize('added', [30.0, 100.0, 150.0])
def test_marks_under_glare_are_ink_though_their_steps_are_small(added: float) -> None:
    glossy = replace(polar(), glare=np.array([215.0], np.float32))
    glossy.gray[:] = np.minimum(glossy.gray + added, 255)
    evidence = edges(glossy)
    assert (evidence.ink > evidence.paper)[..., MARKED].all()
    assert (evidence.ink <= evidence.paper)[..., ~MARKED].all()


@pytest.mark.parametrize('light', [1.0, 0.4, 0.2])
def test_bright_marks_in_shadow_are_ink_though_black_ground_does_not_tell_it(light: float) -> None:
    night = replace(polar(60.0, -1, contrast=0.05), noise=np.array([3.0]))
    night.gray[..., ~MARKED | (np.arange(ANGLES) % 2 > 0)] *= light
    night.gray[night.gray < 10] = 0.0  # black that a camera clips
    seen = edges(replace(night, brightest=np.array([60.0])))
    assert (seen.ink > seen.paper)[..., MARKED].all()
    assert (seen.ink < seen.paper)[..., ~MARKED].all()


def test_readings_of_neighbours_that_are_alike_share_one_weight() -> None:
    sparse, dense = weights(polar(size=60.0)), weights(polar(size=6.0))
    assert sparse.tolist() == [1.0]
    assert dense[0] == pytest.approx(2 * np.pi * 2.25 * 6 / ANGLES / 2.5)
    small, large = (edges(polar(size=of)) for of in (8.0, 16.0))
    of_paper = [(of.paper / of.weight)[0, 0, 15] for of in (small, large)]
    assert of_paper[0] == pytest.approx(of_paper[1])


def test_gaps_tell_how_often_light_has_edges() -> None:
    calm, restless = polar(), polar()
    restless.gray[:, RADII > 1.6, ::3] *= 0.3
    assert edges(calm).lit[0] == pytest.approx(0.05)
    assert edges(restless).lit[0] == pytest.approx(1 / 3, abs=0.02)
    assert (edges(restless).ink[0, :, 1] < edges(calm).ink[0, :, 1]).all()


def by_levels(
    of: PolarImages,
    light: float | np.ndarray | None = 200.0,
    spread: float = 0.05,
    shares: tuple[float, ...] = (),
) -> Evidence:
    """Return what levels say under light of a known spread; None: light as it is seen."""
    radii = np.array([0.5, 1.6, 2.6, 3.1, 3.9])
    values = of.at(radii[None])
    known = values if light is None else np.full_like(values, light)
    known = known, np.full_like(values, spread)
    return level_evidence(of, values, *known, radii, NONE, BAND, shares)


@pytest.mark.parametrize(('polarity', 'paper'), [(1, 200.0), (-1, 50.0)])
def test_levels_tell_ink_from_paper_where_light_is_known(polarity: int, paper: float) -> None:
    evidence, silent, vague = (
        by_levels(polar(200.0, polarity), paper, spread) for spread in (0.05, np.inf, 1.0)
    )
    for half in range(2):
        assert (evidence.ink > evidence.paper)[0, half].tolist() == MARKED.tolist()
    assert evidence.dot[0] > 5
    assert not silent.ink.any() and not silent.paper.any() and not silent.dot.any()
    assert np.abs(vague.ink - vague.paper).max() < np.abs(evidence.ink - evidence.paper).min()


def test_ground_beside_the_band_that_is_not_as_predicted_speaks_against_both() -> None:
    target = polar()
    target.gray[:, inside(BAND[1], 9), :8] = 90.0  # something lies on the margin
    evidence = by_levels(target, spread=0.02)
    assert (evidence.ink[0, 1, :8] < evidence.ink[0, 1, 20:28] - 0.5).all()
    assert (evidence.ink[0, 0, :8] == evidence.ink[0, 0, 20:28]).all()  # of the half inside


def test_a_stretch_in_light_that_nothing_predicts_says_nothing() -> None:
    light = np.where(np.arange(ANGLES) // 12 == 1, 110.0, 200.0)
    evidence = by_levels(polar(light))
    assert not evidence.paper[0, :, 12:24].any() and not evidence.ink[0, :, 12:24].any()
    assert (evidence.ink > evidence.paper)[0, :, 24:].tolist() == [MARKED[24:].tolist()] * 2


def test_what_is_as_dark_as_ink_behind_a_plate_predicts_no_light_on_it() -> None:
    shadow = np.full((5, ANGLES), 200.0)
    shadow[2, 12:24] = 60.0  # in the band, and neither in the gap nor beyond
    evidence = by_levels(polar(), shadow)
    marked = MARKED[12:24]
    assert marked.any() and (evidence.paper < evidence.ink + 0.5)[0, :, 12:24][:, marked].all()


def test_a_dot_of_light_on_paper_is_no_ink() -> None:
    assert by_levels(polar(), None).dot[0] < -5


def test_what_covers_the_ground_covers_the_edge_beside_it_and_the_levels() -> None:
    target = polar(shade=100.0)
    target.gray[:, inside(BAND[1], 9), 5:8] = 90.0
    of_steps = edges(target)
    seen = by_levels(target, shares=SHARES)
    both = of_steps.plus(seen)
    assert np.flatnonzero(both.covered.any(axis=1)).tolist() == [5, 6, 7]
    for name in ('paper', 'ink'):
        of_edges, of_levels, of_both = (getattr(of, name)[0] for of in (of_steps, seen, both))
        assert of_edges[1, 5:8].all() and not of_both[1, 5:8].any()
        assert np.array_equal(of_both[0, 5:8], of_edges[0, 5:8])
        assert np.array_equal(of_both[:, 8:], (of_edges + of_levels)[:, 8:])
