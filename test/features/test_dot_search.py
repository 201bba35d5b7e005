"""The dots of an image: found whole or interrupted, once each, and not where explained."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.features import frame
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import Dots, distinct
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.synthetic.scene import SceneSettings, render

SIZES = (4.0, 60.0)


def scene(light: str):
    return render(
        SceneSettings(
            width=1000, height=700, targets=9, dot_radius=18.0, light=light, ambient=0.12, seed=2
        )
    )


def distances(dots: Dots, rendering) -> np.ndarray:
    """Return the distances of the targets of a scene from the dot next to each, px."""
    centres = dots.frames[:, :2, 2]
    return np.array(
        [
            np.linalg.norm(centres - (target.x, target.y), axis=1).min(initial=np.inf)
            for target in rendering.targets
        ]
    )


def test_whole_dots_of_a_scene_in_even_light_are_its_targets():
    rendering = scene('normal')
    dots = whole_dots(image_pyramid(rendering.image, 60.0), *SIZES, (1,))
    assert distances(dots, rendering).max() < 0.5
    assert set(dots.polarity) == {1}
    assert (dots.share == 1).all()
    assert len(whole_dots(image_pyramid(rendering.image, 60.0), *SIZES, ()).frames) == 0


@pytest.mark.parametrize('light', ['stripe', 'lattice'])
def test_votes_find_dots_whose_outlines_are_interrupted(light):
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
    ],
    ids=lambda view: ', '.join(map(str, view.values())),
)
def test_small_oblique_and_blurred_dots_are_found(view):
    few = {'width': 1200, 'height': 900, 'targets': 9}
    rendering = render(SceneSettings(**few, ambient=0.12, seed=4, **view))
    dots = voted_dots(image_pyramid(rendering.image, 60.0), *SIZES, (1,))
    sizes = np.array([(it.semi_major * it.semi_minor) ** 0.5 for it in rendering.targets])
    assert (distances(dots, rendering) < 0.25 * sizes).all()


def test_edges_within_explained_outlines_do_not_vote():
    rendering = scene('normal')
    pyramid = image_pyramid(rendering.image, 60.0)
    explained = rendering.targets[0]
    square = 4 * explained.semi_major * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    outlines = [square + np.array([explained.x, explained.y])]
    found = distances(voted_dots(pyramid, *SIZES, (1,), outlines), rendering)
    assert found[0] > explained.semi_major
    assert found[1:].max() < 1


def test_of_the_same_dot_found_twice_the_one_with_more_of_its_edge_is_kept():
    frames = frame.affine_frames([50.0, 51.0, 50.0, 80.0], [50.0] * 4, [10, 10, 20, 10], 10.0, 0.0)
    dots = distinct(Dots(frames, np.array([1, 1, 1, 1]), np.array([0.6, 0.9, 0.5, 0.7])))
    assert dots.share.tolist() == [0.9, 0.7, 0.5]  # another size is another dot
    either = distinct(Dots(frames[:2], np.array([1, -1]), np.array([0.6, 0.9])))
    assert either.polarity.tolist() == [-1, 1]


def test_no_dots_in_an_image_of_one_edge():
    gray = np.full((60, 80), 40, np.uint8)
    gray[:, 40:] = 200
    pyramid = image_pyramid(gray, 60.0)
    assert whole_dots(pyramid, *SIZES, (1, -1)).frames.shape == (0, 3, 3)
    assert voted_dots(pyramid, *SIZES, (1, -1)).frames.shape == (0, 3, 3)
