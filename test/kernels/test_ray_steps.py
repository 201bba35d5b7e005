"""The strongest steps along rays, against a plain loop."""

import numpy as np
import pytest

from ahf_ros import kernels


@pytest.mark.parametrize('seed', range(8))
def test_the_strongest_step_of_each_ray_is_found_between_samples(seed: int) -> None:
    generator = np.random.default_rng(seed)
    k, m, n = 1 + seed % 3, [1, 24][seed % 2], [1, 2, 4, 5, 9, 13, 13, 13][seed]
    values = generator.normal(0, 300, (k, m, n)).astype(np.float32)
    scale, radii = generator.choice([-1, 1], k) / 1000, np.sort(generator.random((k, n)), axis=1)
    bounds = -0.3, 0.6, -1e-3
    displacement, strongest, _ = kernels.strongest_steps(values, scale, radii, *bounds)
    for i, j in np.ndindex(k, m):
        if n < 5:
            assert displacement[i, j] == strongest[i, j] == 0
            continue
        steps = (values[i, j, 2:] - values[i, j, :-2]).astype(float) * scale[i]
        steps = np.clip(steps.astype(np.float32), -0.3, 0.6)
        best = min(max(int(steps.argmax()), 1), n - 4)
        before, step, after = steps[best - 1 : best + 2].astype(float)
        shift = 0.5 * (before - after) / min(before - 2 * step + after, -1e-3)
        expected = radii[i, best + 1] + min(max(shift, -1), 1) * (radii[i, 1] - radii[i, 0]) - 1
        assert displacement[i, j] == pytest.approx(expected, abs=1e-9)
        assert strongest[i, j] == pytest.approx(step, abs=1e-9)
    values[:, :, :] = [np.nan, np.inf][seed % 2]
    kernels.strongest_steps(values, scale, radii, *bounds)
