"""Targets of one family and ID, dark ones and bright ones."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.identification.session import identify
from ahf_ros.network.export.survey import MeasuredImage, make_survey
from ahf_ros.scenes.scene import SceneSettings
from support.scenes import rendered


@pytest.mark.parametrize(
    ('family', 'dot_radius'),
    [('gsi', 4), ('dots', 8), pytest.param('cctag3', 24, marks=pytest.mark.lasting)],
)
def test_every_kind_keeps_both_colours_of_an_id(family: str, dot_radius: float) -> None:
    usual = dict(width=360, height=300, targets=2, seed=3, family=family, dot_radius=dot_radius)
    of = [rendered(SceneSettings(**usual, polarity=it)) for it in ('dark', 'bright')]
    found = identify(np.hstack([it.image for it in of]), family=family)
    assert len(found) == found.count == 4
    for sign, shown in zip((1, -1), of, strict=True):
        assert sorted(it.id for it in found if it.polarity == sign) == sorted(
            it.id for it in shown.targets
        )


@pytest.mark.parametrize('family', ['metashape12', 'cct14', 'auto'])
def test_a_dark_and_a_bright_target_of_one_id_are_two(family: str) -> None:
    name = 'aicon14' if family == 'auto' else family
    scene = SceneSettings(width=500, height=400, targets=4, dot_radius=10, seed=3, family=name)
    dark, bright = (rendered(replace(scene, polarity=it)) for it in ('dark', 'bright'))
    shown = np.hstack([dark.image, bright.image])
    found = identify(shown, family=family)
    expected = sorted(
        (it.id, sign, round(it.x + shift), round(it.y))
        for sign, shift, of in ((1, 0, dark), (-1, 500, bright))
        for it in of.targets
    )
    got = sorted((it.id, it.polarity, round(it.x), round(it.y)) for it in found)
    assert got == expected
    assert (found.count, found.repeated) == (8, ())
    twice = identify(np.hstack([dark.image, dark.image, bright.image]), family=family)
    assert sorted(it.id for it in twice) == sorted(it.id for it in bright.targets)
    assert len(twice.repeated) == 8
    image = MeasuredImage('a.png', 1000, 400, found.targets)
    labels = {mark.label for mark in make_survey([image]).photographs[0].marks}
    assert labels == {f'{it.id}{end}' for it in dark.targets for end in ('', '_bright')}
