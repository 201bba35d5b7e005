"""How changes of frames move the edges of their circles, for weighted least squares."""

from __future__ import annotations

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.circles import Circles

_PRIOR_SCALE = 0.003  # standard deviation of the printed proportions of circles and dot
_PRIOR_PERSPECTIVE = 0.02  # of the projective part, in 1 a dot radius
_PRIOR_SHIFT = 1.0  # of the shift of edges towards the dark side, px
_WEAK_PRIOR = 1e-6  # of the other changes, so that they can always be solved for


class DisplacementModel:
    """How changes of k frames, and of what else is unknown, move their edges outwards.

    The unknowns are the changes in the order of `frame.displacement_basis`. In a projective model
    the scale of each group of circles, and the shift of all edges towards the dark side which the
    gamma of a camera causes, follow.
    """

    def __init__(self, circles: Circles, scale: np.ndarray, projective: bool) -> None:
        shared = frame.displacement_basis(circles.angles, circles.radii)
        own = np.zeros((len(scale), len(shared), 0))
        prior: np.ndarray = np.full(5, _WEAK_PRIOR)
        if projective:
            groups = np.arange(1, circles.group.max(initial=0) + 1)
            scales = np.where(circles.group[:, None] == groups, circles.radii[:, None], 0)
            shared = np.concatenate([shared, scales], axis=1)
            own = (-circles.polarity / scale)[..., None]
            deviations = [_PRIOR_PERSPECTIVE] * 2 + [_PRIOR_SCALE] * len(groups) + [_PRIOR_SHIFT]
            prior = np.concatenate([prior, np.array(deviations) ** -2])
        else:
            shared = shared[:, :5]
        self._shared, self._own, self._prior = shared, own, np.diag(prior)
        products = shared[:, :, None] * shared[:, None]
        self.projective = projective
        self._products = products.reshape(len(shared), -1)

    def solve(self, values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the unknowns, shape (k, n), and the normal matrices of weighted least squares."""
        count, known = len(values), self._shared.shape[1]
        weighted = weights[..., None] * self._own
        mixed = weighted.transpose(0, 2, 1) @ self._shared
        normal = np.empty((count, *self._prior.shape))
        normal[:, :known, :known] = (weights @ self._products).reshape(count, known, known)
        normal[:, known:, :known] = mixed
        normal[:, :known, known:] = mixed.transpose(0, 2, 1)
        normal[:, known:, known:] = weighted.transpose(0, 2, 1) @ self._own
        normal += self._prior
        right = np.concatenate(
            [(weights * values) @ self._shared, (weighted * values[..., None]).sum(axis=1)], axis=1
        )
        return np.linalg.solve(normal, right[..., None])[..., 0], normal

    def displacement(self, unknowns: np.ndarray) -> np.ndarray:
        """Return how far unknowns, shape (k, n), move the edges, dot radii, shape (k, m)."""
        known = self._shared.shape[1]
        own = (self._own @ unknowns[:, known:, None])[..., 0]
        return unknowns[:, :known] @ self._shared.T + own

    def influence(self, normal: np.ndarray) -> np.ndarray:
        """Return what a weighted displacement does to the translation, shape (k, 2, m)."""
        known = self._shared.shape[1]
        inverse = np.linalg.inv(normal)[:, :2]
        own = inverse[:, :, known:] @ self._own.transpose(0, 2, 1)
        return inverse[:, :, :known] @ self._shared.T + own
