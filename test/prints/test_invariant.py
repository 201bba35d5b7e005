"""The P2-invariant, and the worked example of Wang et al. (Tables 3 to 5)."""

import numpy as np
import pytest

from ahf_ros.families.published.gsi import area_cross_ratio, p2_invariant, template_invariant
from ahf_ros.prints.gsi import point_family

# Table 3, px. A is printed as (2047.00, 1072.58), where two digits changed places.
TABLE_3 = {
    'A': (2407.00, 1072.58),
    'B': (2326.77, 1133.63),
    'C': (2331.21, 1170.83),
    'D': (2368.04, 1166.33),
    'E': (2364.86, 1127.35),
}


@pytest.mark.parametrize('ratio', [0.3, 2.0, -1.7, 40.0])
def test_the_invariant_is_that_of_all_orders_of_the_points(ratio: float) -> None:
    orders = [ratio, 1 / ratio, 1 - ratio, 1 / (1 - ratio), 1 - 1 / ratio, ratio / (ratio - 1)]
    assert np.ptp(p2_invariant(orders)) < 1e-12


def test_the_formula_as_published() -> None:
    ratio = 0.7
    first = ratio**6 - 3 * ratio**5 + 3 * ratio**4 - ratio**3 + 3 * ratio**2 - 3 * ratio + 1
    second = 2 * ratio**6 - 6 * ratio**5 + 9 * ratio**4 - 8 * ratio**3 + 9 * ratio**2
    second += -6 * ratio + 2
    scale = ratio**2 * (ratio - 1) ** 2
    assert p2_invariant(ratio) == pytest.approx((second / scale) / (first / scale), rel=1e-12)


def test_the_invariant_is_bounded_also_where_points_coincide() -> None:
    values = p2_invariant([0.0, 1.0, 1e12, -1e12, -1.0, 2.0, 0.5])
    assert values == pytest.approx([2, 2, 2, 2, 2.8, 2.8, 2.8])
    assert np.isnan(p2_invariant(np.nan))


def test_projections_leave_the_invariant_of_the_printed_design() -> None:
    template = point_family().template
    assert template_invariant(template) == pytest.approx(2.4738, abs=5e-5)
    generator = np.random.default_rng(3)
    for _ in range(20):
        homography = np.eye(3) + generator.uniform(-0.2, 0.2, (3, 3)) * [1, 1, 1]
        homography[2, :2] /= 30
        seen = np.column_stack([template, np.ones(5)]) @ homography.T
        assert template_invariant(seen[:, :2] / seen[:, 2:]) == pytest.approx(2.4738, abs=5e-5)


def test_e_on_the_diagonal_of_12_would_have_the_value_of_the_text() -> None:
    template = point_family().template.copy()
    template[4] = 12.0
    assert template_invariant(template) == pytest.approx(2.402, abs=5e-4)


def test_only_the_points_off_the_line_have_a_cross_ratio() -> None:
    a, b, c, d, e = point_family().template
    assert area_cross_ratio(d, [b, c, e, a]) == pytest.approx(0.6617, abs=5e-5)
    assert not np.isfinite(area_cross_ratio(c, [a, e, b, d])) or area_cross_ratio(
        c, [a, e, b, d]
    ) == pytest.approx(1)


def test_table_3_has_the_invariant_of_the_design() -> None:
    measured = template_invariant([TABLE_3[name] for name in 'ABCDE'])
    assert measured == pytest.approx(2.481, abs=5e-4)
