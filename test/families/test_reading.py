"""Reading bands in the frames of their dots: words, covers, growth and what is no target."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.polar import polar_images
from ahf_ros.families.ring.reading import _by_dot, best_growth, read_bands
from ahf_ros.prints.ring import FAMILY_NAMES, canonical, family, ring_family
from ahf_ros.scenes.scene import Rendering, SceneSettings
from ahf_ros.vision.circle_fit import Fit
from support.ring import lone_dot, measured
from support.scenes import rendered

SMALL = SceneSettings(width=800, height=600, targets=6, dot_radius=18.0, seed=7)
CODE = family(SMALL.family)
LIGHTS = ('stripe', 'lattice', 'fringe', 'shadow', 'spots')


def dots_of(rendering: Rendering) -> Fit:
    """Return the dots of a scene, measured from where they truly are."""
    x, y, radii = np.array([(of.x, of.y, of.semi_major) for of in rendering.targets]).T
    polarity = 1 if rendering.settings.dark else -1
    return measured(rendering.image, x, y, radii, polarity)


def read(rendering: Rendering, name: str = '') -> Hypotheses:
    gray = rendering.image.astype(np.float32)
    return read_bands(gray, dots_of(rendering), family(name or rendering.settings.family))


@pytest.mark.parametrize(
    ('changes', 'margin', 'hidden'),
    [
        *(({'family': name, 'polarity': 'dark'}, 10, 0) for name in FAMILY_NAMES),
        *(({'family': name, 'polarity': 'bright'}, 10, 0) for name in FAMILY_NAMES),
        *(({'light': light}, 5, 0.1) for light in LIGHTS),
    ],
)
def test_words_are_read_in_their_direction(
    changes: dict[str, str], margin: float, hidden: float
) -> None:
    shown = rendered(replace(SMALL, **changes))
    found = read(shown)
    codes, numbers = canonical(found.words, family(shown.settings.family))
    assert codes.tolist() == [target.code for target in shown.targets]
    assert numbers.tolist() == [target.id for target in shown.targets]
    assert found.margin.min() > margin
    assert found.marked.min() > 0
    assert found.certain.all()
    assert found.hidden.max() <= hidden


def test_bands_thinner_than_their_edges_are_soft_are_read(tmp_path: Path) -> None:
    file = tmp_path / 'thin.json'
    words = [22453, 735, 5943, 3689, 12733, 11605]
    file.write_text(json.dumps({'family': 'thin', 'bits': 18, 'band': [2.3, 2.8], 'words': words}))
    scene = replace(SMALL, dot_radius=5.1, edge_shift=-0.5, family='thin', family_file=str(file))
    shown = rendered(replace(scene, width=400, height=300))
    code = ring_family(str(file))
    found = read_bands(shown.image.astype(np.float32), dots_of(shown), code)
    right = canonical(found.words, code)[1] == [target.id for target in shown.targets]
    assert (right & found.certain).sum() >= 5
    assert not (found.certain & ~right).any()


@pytest.mark.parametrize('shift', [-1.2, -0.8, 0.8, 1.2])
@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_growth_is_found_on_ink_that_has_grown(polarity: str, shift: float) -> None:
    """To half a step of the growths that are tried, and the camera's gamma has a share in it."""
    scene = replace(SMALL, dot_radius=12.0, polarity=polarity)
    sign = 1 if polarity == 'dark' else -1
    found = []
    for of in (0.0, shift):
        rendering = rendered(replace(scene, edge_shift=of))
        dots = dots_of(rendering)
        image = polar_images(rendering.image.astype(np.float32), dots, CODE.band, 120)
        found.append(sign * best_growth(image, CODE.band) * dots.size)
    assert np.mean(found[1] - found[0]) == pytest.approx(shift, abs=0.35)


def sectors_at(rendering: Rendering, start: float) -> tuple[np.ndarray, np.ndarray]:
    """Return at which sector of the first target each pixel lies, and how far out, dot radii."""
    target = rendering.targets[0]
    rows, columns = np.indices(rendering.image.shape)
    x, y = (columns - target.x) / target.semi_major, (target.y - rows) / target.semi_major
    turn = (np.arctan2(y, x) - start) % (2 * np.pi)
    return turn / (2 * np.pi) * CODE.bits, np.hypot(x, y)


@pytest.mark.parametrize('first', range(0, 12, 2))
def test_a_covered_part_says_nothing_about_the_word(first: int) -> None:
    rendering = rendered(SMALL)
    clean = read(rendering)
    sector, away = sectors_at(rendering, clean.starts[0])
    inside = (sector > first + 0.3) & (sector < first + 1.7) & (away > 1.5) & (away < 4.2)
    covered = np.where(inside, np.uint8(128), rendering.image)
    found = read(replace(rendering, image=covered))
    assert canonical(found.words, CODE)[1].tolist() == canonical(clean.words, CODE)[1].tolist()
    assert found.hidden[0] < 0.16
    assert not found.hidden[1:].any()
    assert found.seen[0] < clean.seen[0]


@pytest.mark.parametrize('ring', [False, True], ids=['bare paper', 'a ring of ink'])
def test_what_has_no_sectors_is_no_target(ring: bool) -> None:
    rendering = rendered(SMALL)
    _, away = sectors_at(rendering, 0.0)
    image = np.where((away > 1.6) & (away < 4.2), np.uint8(200), rendering.image)
    if ring:
        image = np.where((away > 2.25) & (away < 3.5), np.uint8(60), image)
    found = read(replace(rendering, image=image))
    assert ring or found.words[0] == 0 or found.marked[0] < 0
    assert found.certain.tolist() == [False] + 5 * [True]


def test_arcs_of_another_number_of_sectors_are_explained_worse() -> None:
    other = rendered(replace(SMALL, family='metashape14'))
    right, wrong = read(other), read(other, SMALL.family)
    assert right.coded.min() > -10
    assert (wrong.coded < right.coded - 10).all()


def test_no_dots_no_readings() -> None:
    rendering = rendered(SMALL)
    none = dots_of(rendering).select(np.zeros(6, bool))
    assert read_bands(rendering.image.astype(np.float32), none, CODE).words.shape == (0,)


def test_a_dot_on_bare_paper_leaves_nothing_to_read() -> None:
    gray = lone_dot()
    found = read_bands(gray, measured(gray, [150.0], [100.0], 12.0), CODE)
    assert found.words.tolist() == [0]
    assert not found.certain.any()


def test_a_dot_alone_without_a_covariance_has_that_of_the_joint_fit() -> None:
    y, x = np.mgrid[:61, :61].astype(np.float32)
    gray = np.where(np.hypot(x - 30, y - 30) < 8, 45.0, 180.0).astype(np.float32)
    joint = measured(gray, [30.0], [30.0], 8.0)
    unknown = replace(joint, covariance=np.full((1, 2, 2), np.nan))
    alone = _by_dot(joint, unknown, np.zeros(1), np.array([0]))
    assert np.array_equal(alone.covariance, joint.covariance)
