"""Rings of CCTags: those whose IDs are likely, and those that are brought onto an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.logistic import logistic

_OF_TARGET = np.array([-14.1, -1.5, 3.0, -1.0, 1.0])  # of one, and of what follows
_PLAIN = -5.0, 5.0  # beyond which it says no more
_BY_SIZE, _SMALL = 2.5, 12.0  # what `plain` grows by ln of the radius, up to so many px
_AS_CLEAR = -6.0  # as it gets, by anything that is round
_OF_ID = np.array([-1.4, 1.2])  # of one, margin


@dataclass(frozen=True, slots=True)
class Aligned(ArrayRecord):
    """The rings of k IDs as they are brought onto an image."""

    frames: np.ndarray  # (k, 3, 3), of the outermost circles as printed
    ids: np.ndarray  # int, (k,)
    covariance: np.ndarray  # (k, 2, 2), of centres, px^2
    shift: np.ndarray  # (k,), by which ink has grown, px
    blur: np.ndarray  # (k,), standard deviation, px
    sharpening: np.ndarray  # (k,), amount of an unsharp mask
    colour: np.ndarray  # (k,), 1 where ink is dark, -1 where it is bright
    rays: np.ndarray  # (k,), share of the rays that show the rings by themselves
    clear: np.ndarray  # (k,), ln of the share of a ray that is not explained, of clear rays
    left: np.ndarray  # (k,), ln of the share of a ray that is not explained, on the mean
    plain: np.ndarray  # (k,), the same of any two edges, less that of the rings
    unusual: np.ndarray  # (k,), half the squares of deviations of edges, that leave a doubt
    known: np.ndarray  # (k,), share of gray values that are not clipped
    margin: np.ndarray  # (k,), ln of the odds against the next ID; NaN before it is known
    by_pixels: np.ndarray  # (k,), ln of the odds that there is a target, by pixels: 0 if not asked

    @property
    def edges(self) -> np.ndarray:
        """Shift, blur and sharpening, shape (k, 3)."""
        return np.stack([self.shift, self.blur, self.sharpening], axis=1)

    @property
    def edge_shift(self) -> np.ndarray:
        """By how much what is dark has grown, px, shape (k,)."""
        return self.shift * self.colour

    @property
    def of_target(self) -> np.ndarray:
        """Probability that there is a target, shape (k,)."""
        small = np.minimum(frame.mean_radii(self.frames) / _SMALL, 1)
        plain = np.clip(self.plain - _BY_SIZE * np.log(small), *_PLAIN)
        features = [np.maximum(self.clear, _AS_CLEAR), plain, self.unusual, self.by_pixels]
        return logistic(np.stack(features, axis=1), _OF_TARGET)

    @property
    def of_id(self) -> np.ndarray:
        """Probability that a target has the ID, shape (k,)."""
        return logistic(self.margin[:, None], _OF_ID)

    @property
    def confidence(self) -> np.ndarray:
        """Probability that there is a target with the ID, shape (k,)."""
        return self.of_target * self.of_id


NOTHING = Aligned(
    *(np.zeros((0, 3, 3)), np.zeros(0, int), np.zeros((0, 2, 2)), *np.zeros((12, 0)))
)


@dataclass(frozen=True, slots=True)
class Likely(ArrayRecord):
    """The n likeliest IDs of k targets, by their mean profiles."""

    starts: np.ndarray  # (k, n, 3, 3), frames
    ids: np.ndarray  # int, (k, n)
    edges: np.ndarray  # (k, n, 3): growth of ink and blur, px, and sharpening
    shares: np.ndarray  # (k, n), of the mean profile that rings with the ID explain
    rings: np.ndarray  # bool, (k,), whether there may be rings of any ID

    @property
    def first(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frames, IDs and edges of the likeliest IDs, k rows each."""
        return self.starts[:, 0], self.ids[:, 0], self.edges[:, 0]

    @property
    def repeated(self) -> np.ndarray:
        """Return which IDs are in their row before, (k, n)."""
        same = self.ids[:, :, None] == self.ids[:, None]
        return np.asarray(same.argmax(axis=2) != np.arange(self.ids.shape[1]))

    def at(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return frames, IDs and edges of some IDs of targets."""
        return self.starts[rows, columns], self.ids[rows, columns], self.edges[rows, columns]

    def beside(self, others: Likely) -> Likely:
        """Return the IDs followed by others of the same targets."""
        return Likely(
            starts=np.concatenate([self.starts, others.starts], axis=1),
            ids=np.concatenate([self.ids, others.ids], axis=1),
            edges=np.concatenate([self.edges, others.edges], axis=1),
            shares=np.concatenate([self.shares, others.shares], axis=1),
            rings=self.rings,
        )
