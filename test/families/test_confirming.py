"""Ring targets that are known are read again where they are expected."""

from dataclasses import replace

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import SceneSettings, render

WALL = SceneSettings(
    width=1400, height=1000, targets=24, dot_radius=8.0, family='aicon12', seed=73, phases=6
)


def test_what_is_confirmed_is_what_was_known() -> None:
    image = render(replace(WALL, targets=8)).image
    detect = create_detector('ring', settings=DetectorSettings(family=WALL.family))
    first, second, *others = detect(image)
    foreign = replace(second, family='metashape12')
    mistaken = replace(first, id=second.id, code=second.code)
    confirmed = detect.confirm(image, [mistaken, foreign, *others])
    assert {it.id for it in confirmed.targets} == {it.id for it in others}
    height, width = image.shape
    found = confirmed.search([(0, 0, width, height)])
    assert {it.id for it in found} == {it.id for it in (first, second, *others)}


def test_known_targets_are_confirmed_under_a_pattern_that_moves_over_them() -> None:
    detect = create_detector('ring', settings=DetectorSettings(family=WALL.family))
    known = detect(render(WALL).image)
    assert len(known) == WALL.targets
    confirmed = 0
    for phase in range(WALL.phases):
        scene = render(replace(WALL, light='stripe', ambient=0.04), phase)
        figures = score(scene, detect.confirm(scene.image, known).targets)
        assert not figures.wrong
        confirmed += figures.right
    assert confirmed >= 0.97 * WALL.phases * WALL.targets  # 142 of 144; 130 in the shapes of dots
