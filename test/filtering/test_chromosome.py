from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.filtering.chromosome import Gene, decoded, encoded

HIGH = Gene('gamma_high', 1.0, 4.0, 0.1)
LOW = Gene('gamma_low', 0.0, 1.0, 0.01)


def test_the_published_genes_have_5_and_7_bits_and_3131_values():
    assert (HIGH.bits, LOW.bits) == (5, 7)
    assert HIGH.count * LOW.count == 3131


@pytest.mark.parametrize(
    'gene', [HIGH, LOW, Gene('one', 2.0, 2.0, 0.5), Gene('two', 0.0, 1.0, 1.0)]
)
def test_every_code_means_a_value_in_order_and_every_value_has_a_code(gene):
    values = [gene.value(gene.index(code)) for code in range(2**gene.bits)]
    assert values == sorted(values)
    assert values[0] == gene.minimum
    assert values[-1] == gene.maximum
    assert len(set(values)) == gene.count


def test_values_are_free_of_rounding_errors():
    assert [HIGH.value(index) for index in (0, 2, 7, 30)] == [1.0, 1.2, 1.7, 4.0]


@pytest.mark.parametrize('gene', [HIGH, LOW, Gene('one', 2.0, 2.0, 0.5)])
def test_the_code_of_a_value_means_that_value(gene):
    for index in range(gene.count):
        assert gene.index(gene.code(gene.value(index))) == index


def test_a_value_out_of_range_is_coded_as_the_nearest():
    assert HIGH.index(HIGH.code(9.0)) == 30
    assert HIGH.index(HIGH.code(-9.0)) == 0
    assert HIGH.index(HIGH.code(1.26)) == 3


def test_the_maximum_need_not_be_a_whole_number_of_steps_away():
    gene = Gene('gain', 1.0, 2.0, 0.3)
    assert [gene.value(index) for index in range(gene.count)] == [1.0, 1.3, 1.6, 1.9]


def test_a_chromosome_is_the_genes_in_order_highest_bit_first():
    genes = [Gene('first', 0.0, 3.0, 1.0), Gene('second', 0.0, 7.0, 1.0)]
    assert decoded(np.array([1, 0, 0, 1, 1], bool), genes) == (2.0, 3.0)
    assert encoded((2.0, 3.0), genes) == [True, False, False, True, True]


@pytest.mark.parametrize(
    ('numbers', 'words'),
    [
        ((2.0, 1.0, 0.1), r'gain_maximum is 1.0, accepted is a number of at least .* 2'),
        ((1.0, 2.0, 0.0), r'gain_step is 0.0, accepted is a number above 0'),
        ((1.0, 2.0, -0.1), r'gain_step is -0.1'),
        ((float('nan'), 2.0, 0.1), r'gain_minimum is nan, accepted is a finite number'),
        ((1.0, float('inf'), 0.1), r'gain_maximum is inf'),
    ],
)
def test_a_range_that_makes_no_sense_is_refused(numbers, words):
    with pytest.raises(ValueError, match=words):
        Gene('gain', *numbers)
