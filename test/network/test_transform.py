import numpy as np
import pytest

from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.transform import Transform


def test_the_inverse_of_the_inverse_is_the_transform() -> None:
    root = np.random.default_rng(1).normal(size=(6, 6))
    of = Transform(
        rotation_matrices(np.array([[0.3, -2.0, 1.0]]))[0], np.arange(3.0), root @ root.T
    )
    again = of.inverse.inverse
    for name in ('rotation', 'translation', 'covariance'):
        assert np.allclose(getattr(of, name), getattr(again, name))


@pytest.mark.parametrize(
    'vector',
    [(0, 0, 0), (1e-6, 0, -2e-6), (np.pi, 0, 0), (3.1, 0, 0), (0, -3, 0.5), (0.2, 1, -2.9)],
)
def test_quaternions_turn_as_rotations_do(vector: tuple[float, ...]) -> None:
    rotation = rotation_matrices(np.array([vector], float))[0]
    of = Transform(rotation)
    x, y, z, w = of.quaternion
    assert w >= 0
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    assert np.allclose(np.eye(3) + 2 * w * cross + 2 * cross @ cross, rotation, atol=1e-12)
    assert np.allclose(rotation_matrices(of.turn[None])[0], rotation, atol=1e-12)
