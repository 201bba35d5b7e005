"""The dots of an image: found whole or interrupted, once each, and not where explained."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from ahf_ros.vision import frame
from ahf_ros.vision.dot_search import voted_dots, whole_dots, whole_outlines
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.log_edges import LogEdges, find_edges
from ahf_ros.vision.pyramid import image_pyramid, log_image
from support.drawn_dots import drawn

SIZES = (4.0, 60.0)


@cache
def scene(light: str) -> Rendering:
    return render(
        SceneSettings(
            width=1000, height=700, targets=9, dot_radius=18.0, light=light, ambient=0.12, seed=2
        )
    )


def first_edges(gray: np.ndarray) -> LogEdges:
    return image_pyramid(gray, 60.0).edges[0]


def distances(dots: Dots, rendering: Rendering) -> np.ndarray:
    """Return the distances of the targets of a scene from the dot next to each, px."""
    centres = dots.frames[:, :2, 2]
    return np.array(
        [
            np.linalg.norm(centres - (target.x, target.y), axis=1).min(initial=np.inf)
            for target in rendering.targets
        ]
    )


def test_whole_dots_of_a_scene_in_even_light_are_its_targets() -> None:
    rendering = scene('normal')
    dots = whole_dots(image_pyramid(rendering.image, 60.0), *SIZES, (1,))
    assert distances(dots, rendering).max() < 0.5
    assert set(dots.polarity) == {1}
    assert (dots.share == 1).all()
    assert len(whole_dots(image_pyramid(rendering.image, 60.0), *SIZES, ()).frames) == 0


@pytest.mark.parametrize('light', ['stripe', 'lattice'])
def test_votes_find_dots_whose_outlines_are_interrupted(light: str) -> None:
    rendering = scene(light)
    pyramid = image_pyramid(rendering.image, 60.0)
    assert distances(whole_dots(pyramid, *SIZES, (1,)), rendering).max() > 5
    dots = voted_dots(pyramid, *SIZES, (1,))
    assert distances(dots, rendering).max() < 1
    assert set(dots.polarity) == {1}
    assert (np.diff(dots.share) <= 0).all()
    centres = dots.frames[:, :2, 2]
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    size = frame.mean_radii(dots.frames)
    alike = np.abs(np.log(size[:, None] / size)) < 0.3
    assert (apart[~np.eye(len(size), dtype=bool) & alike] > 0.3 * size.min()).all()


@pytest.mark.parametrize(
    'view',
    [
        {'dot_radius': 6.0, 'light': 'stripe'},
        {'dot_radius': 6.0, 'light': 'lattice'},
        {'tilt': 62.0, 'focal_length': 3.0, 'light': 'stripe'},
        {'tilt': 62.0, 'focal_length': 3.0, 'light': 'lattice'},
        {'blur': 2.0, 'light': 'fine_stripe'},
        {'dot_radius': 18.0, 'light': 'shadow'},
    ],
    ids=lambda view: ', '.join(map(str, view.values())),
)
def test_small_oblique_blurred_and_shaded_dots_are_found(view: dict[str, float | str]) -> None:
    few = {'width': 1200, 'height': 900, 'targets': 9}
    rendering = render(SceneSettings(**few, ambient=0.12, seed=4, **view))
    dots = voted_dots(image_pyramid(rendering.image, 60.0), *SIZES, (1,))
    sizes = np.array([(it.semi_major * it.semi_minor) ** 0.5 for it in rendering.targets])
    assert (distances(dots, rendering) < 0.25 * sizes).all()


def test_edges_within_explained_outlines_do_not_vote() -> None:
    rendering = scene('normal')
    pyramid = image_pyramid(rendering.image, 60.0)
    explained = rendering.targets[0]
    square = 4 * explained.semi_major * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    outlines = [square + np.array([explained.x, explained.y])]
    found = distances(voted_dots(pyramid, *SIZES, (1,), outlines), rendering)
    assert found[0] > explained.semi_major
    assert found[1:].max() < 1


@pytest.mark.parametrize('level', [40, 200])
def test_no_dots_in_an_image_of_one_edge_or_none(level: int) -> None:
    gray = np.full((60, 80), 40, np.uint8)
    gray[:, 40:] = level
    pyramid = image_pyramid(gray, 60.0)
    assert bool(len(pyramid.edges[0].x)) == (level == 200)
    assert whole_dots(pyramid, *SIZES, (1, -1)).frames.shape == (0, 3, 3)
    assert voted_dots(pyramid, *SIZES, (1, -1)).frames.shape == (0, 3, 3)


@pytest.mark.parametrize('polarity', [1, -1])
@pytest.mark.parametrize(('paper', 'ink'), [(200, 30), (70, 20)], ids=['lit', 'shadow'])
def test_a_whole_outline_is_an_ellipse(polarity: int, paper: int, ink: int) -> None:
    colours = (paper, ink) if polarity == 1 else (ink, paper)
    dots = whole_outlines(first_edges(drawn([(100.3, 80.6, 14.0)], *colours)), 2, 30)
    assert dots.polarity.tolist() == [polarity]
    whole = frame.enlarged(dots.frames, 1)
    assert whole[0, :2, 2] == pytest.approx((100.3, 80.6), abs=0.3)
    major, minor, _ = frame.ellipse_axes(whole)
    assert (major[0], minor[0]) == pytest.approx((14, 14), abs=1)


def test_outlines_of_another_size_are_left_out() -> None:
    edges = first_edges(drawn([(80, 80, 8.0), (200, 120, 24.0)]))
    small = whole_outlines(edges, 2, 7).frames
    large = whole_outlines(edges, 7, 30).frames
    assert frame.enlarged(small, 1)[:, :2, 2] == pytest.approx(np.array([[80, 80]]), abs=0.5)
    assert frame.enlarged(large, 1)[:, :2, 2] == pytest.approx(np.array([[200, 120]]), abs=0.5)


def test_more_dots_than_are_looked_at_are_said_and_the_roundest_stay(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    places = [(x, y) for x in range(20, 400, 40) for y in range(20, 400, 40)]
    dots = [(x, y, 9, 9 if y < 200 else 6, 0.5) for x, y in places]
    edges = find_edges(log_image(drawn(dots, shape=(400, 400))))
    messages: list[str] = []
    log = SimpleNamespace(warning=lambda text, *values: messages.append(text % values))
    monkeypatch.setattr('ahf_ros.base.notices._LOG', log)
    assert len(whole_outlines(edges, 4.0, 20.0).frames) == 100
    assert messages == []
    monkeypatch.setattr('ahf_ros.vision.dot_search.MAXIMUM_OUTLINES', 30)
    assert len(whole_outlines(edges, 4.0, 20.0).frames) == 30
    assert messages == ['100 whole ellipses; the 30 best are looked at']
