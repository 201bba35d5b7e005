from dataclasses import astuple
from typing import Any

import numpy as np
import pytest

from ahf_ros.identification.filtering.genes import FIRST, genes_of, tuned
from ahf_ros.identification.filtering.genetic import decoded, encoded
from ahf_ros.identification.filtering.homomorphic import median_distance, transfer
from ahf_ros.identification.filtering.settings import (
    EXTENDED,
    PUBLISHED,
    AdaptiveSettings,
    FilterSettings,
    GeneticSettings,
    TuningSettings,
)
from support.fourier import filtered_logarithm_fft

SHAPE = (48, 64)


def test_the_published_search_tunes_the_gains_of_the_paper() -> None:
    high, low = genes_of(TuningSettings(search=PUBLISHED))
    assert (high.count, high.bits, high.value(0), high.value(30)) == (31, 5, 1.0, 4.0)
    assert (low.count, low.bits, low.value(0), low.value(100)) == (101, 7, 0.0, 1.0)
    assert tuned(SHAPE, (2.8, 0.82)) == transfer(SHAPE, 2.8, 0.82)


def test_an_extended_search_also_tunes_cutoff_and_exponent() -> None:
    settings = TuningSettings(search=EXTENDED, cutoff_min=0.25, cutoff_max=2, exponent_min=0.3)
    *gains, cutoff, exponent = genes_of(settings)
    assert tuple(gains) == genes_of(TuningSettings(search=PUBLISHED))
    octaves = [-2, -1.5, -1, -0.5, 0, 0.5, 1]
    assert [cutoff.value(index) for index in range(cutoff.count)] == octaves
    assert [exponent.value(index) for index in range(exponent.count)] == [-1, 0]
    assert tuned(SHAPE, (2.8, 0.82, 0.0, 0.0)) == transfer(SHAPE, 2.8, 0.82)
    chosen = tuned(SHAPE, (3.0, 1.0, -1.0, -2.0))
    assert (chosen.gamma_high, chosen.gamma_low, chosen.attenuation) == (0.75, 0.25, 2.0)
    assert chosen.cutoff == median_distance(*SHAPE) / 2
    assert tuned(SHAPE, (1.0, 1.0, -1.0, -2.0)).attenuation == 0


def test_an_exponent_is_a_power_of_the_filtered_image() -> None:
    image = np.random.default_rng(1).integers(20, 255, SHAPE).astype(np.uint8)
    whole, root = (
        filtered_logarithm_fft(image, *astuple(tuned(SHAPE, (2.0, 0.5, -0.5, exponent))))
        for exponent in (0.0, -1.0)
    )
    assert np.allclose(np.exp(root), np.sqrt(np.exp(whole)), rtol=1e-4)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        (
            {'gamma_high_min': 3.0, 'gamma_high_max': 2.0},
            'gamma_high_min is 3.0, accepted is a number of at most gamma_high_max, 2.0',
        ),
        ({'gamma_low_min': 0.8, 'gamma_low_max': 0.2}, 'gamma_low_min is 0.8'),
        (
            {'gamma_low_max': 1.5},
            'gamma_low_max is 1.5, accepted is a number of at most gamma_high_min, 1.0',
        ),
        ({'gamma_high_step': 0.0}, 'gamma_high_step is 0.0, accepted is a number from 0.001'),
        ({'gamma_low_min': float('nan')}, 'gamma_low_min is nan'),
        (
            {'cutoff_min': 1.5, 'cutoff_max': 0.5},
            'cutoff_min is 1.5, accepted is a number of at most cutoff_max, 0.5',
        ),
        ({'search': 'full'}, "search is 'full', accepted is one of extended, published"),
        ({'exponent_min': 0.0}, 'exponent_min is 0.0, accepted is a number from 0.01'),
    ],
)
def test_a_range_that_makes_no_sense_is_refused(
    values: dict[str, float] | dict[str, str], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        TuningSettings(**values)


@pytest.mark.parametrize(
    ('settings', 'name', 'value'),
    [
        (AdaptiveSettings, 'threads', -1),
        (AdaptiveSettings, 'ahf', 1),
        (FilterSettings, 'log_offset', 0.0),
        (FilterSettings, 'black_percentile', 50.0),
        (FilterSettings, 'white_percentile', 101.0),
        (GeneticSettings, 'population', 1),
        (GeneticSettings, 'population', 50.0),
        (GeneticSettings, 'generations', 0),
        (GeneticSettings, 'stall', 0),
        (GeneticSettings, 'tournament', 0),
        (GeneticSettings, 'crossover', 1.1),
        (GeneticSettings, 'mutation', -0.1),
        (GeneticSettings, 'mutation', float('nan')),
        (GeneticSettings, 'max_evaluations', -1),
        (GeneticSettings, 'max_duration', -1.0),
        (GeneticSettings, 'seed', -1),
    ],
)
def test_a_setting_out_of_range_is_refused(settings: Any, name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f'^{name} is {value}, accepted is'):
        settings(**{name: value})


def test_the_first_filters_are_chromosomes_far_apart() -> None:
    genes = genes_of(TuningSettings())
    for values in FIRST:
        assert np.allclose(decoded(np.array(encoded(values, genes)), genes), values)
    light_kept = [values[1] / values[0] for values in FIRST]
    assert max(light_kept) > 4 * min(light_kept)
