"""The registry of detectors and the settings that they share."""

from __future__ import annotations

import pytest

from ahf_ros.detectors import DETECTOR, DETECTOR_NAMES, DetectorSettings, create


@pytest.mark.parametrize('name', DETECTOR_NAMES)
def test_every_detector_is_called_as_it_is_registered(name):
    assert create(name).name == name


def test_the_default_is_registered():
    assert DETECTOR.default in DETECTOR_NAMES


def test_an_unknown_detector_is_refused_by_name():
    with pytest.raises(ValueError, match=r"detector is 'magic', accepted is one of .*traditional"):
        create('magic')


def test_settings_reach_the_detector():
    settings = DetectorSettings(family='aicon14')
    assert create('traditional', settings).settings == settings


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'family': 'ring12'}, r"family is 'ring12', accepted is one of metashape12, "),
        ({'polarity': 'black'}, r"polarity is 'black', accepted is one of auto, dark, bright"),
        ({'min_radius': 0.5}, r'min_radius is 0.5, accepted is a number from 1 to 10000'),
        ({'min_radius': 61.0}, r'min_radius is 61.0, accepted .* at most max_radius, 60.0'),
        ({'report_undecoded': 1}, r'report_undecoded is 1, accepted is true or false'),
    ],
)
def test_settings_that_make_no_sense_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        DetectorSettings(**change)
