"""Gray values read on the circles of ring targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.features import frame
from ahf_ros.features.sampling import sample_circles, within
from ahf_ros.imaging.black import lifted

_BESIDE = 2.6  # distance of a reading from an edge that is sharp, px
_NEAREST, _FARTHEST = 0.13, 0.36  # bounds of that distance, dot radii
_SOFT, _BESIDE_SOFT = 1.0, 3.0  # blur of an edge, px, from which that distance grows, and how fast
_PERSPECTIVE = 1.5  # of circles, more than their perspective makes one side of them larger
_BAND_DEPTHS = (0.3, 0.5, 0.7)  # shares of the width of the band, where its level is read
_GAP_DEPTHS = (0.35, 0.65)  # shares of the width of the gap, where its level is read
_DOT_RADII = (0.35, 0.7)  # where the level of the dot is read, dot radii


@dataclass(frozen=True, slots=True)
class BandSamples:
    """Gray values of k targets at m angles, each on a circle of its own; none is negative.

    Attributes
    ----------
    inner_ground, inner_band : ndarray of float32, shape (k, m)
        Beside the inner edge of the band, in the gap and in the band.
    outer_band, outer_ground : ndarray of float32, shape (k, m)
        Beside the outer edge of the band, in the band and outside of it.
    band : ndarray of float32, shape (3, k, m)
        In the band, away from its edges.
    gap : ndarray of float32, shape (2, k, m)
        In the gap between dot and band, away from their edges.
    dot : ndarray of float32, shape (2, k, m)
        In the dot.
    on_edges : ndarray of float32, shape (2, k, m)
        On the inner and on the outer edge of the band.
    beside : ndarray of float64, shape (k, 1)
        Distance of readings beside an edge from it, dot radii.
    visible : ndarray of bool, shape (2, k, m)
        Whether the image shows the readings beside the inner edge, and those beside the outer one.
    """

    inner_ground: np.ndarray
    inner_band: np.ndarray
    outer_band: np.ndarray
    outer_ground: np.ndarray
    band: np.ndarray
    gap: np.ndarray
    dot: np.ndarray
    on_edges: np.ndarray
    beside: np.ndarray
    visible: np.ndarray

    @property
    def edges(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Ground and band beside the inner edge of the band, and beside the outer one."""
        return (self.inner_ground, self.inner_band), (self.outer_ground, self.outer_band)

    @property
    def ground(self) -> np.ndarray:
        """All readings that no mark lies on, ndarray of float32, shape (4, k, m)."""
        return np.stack([*self.gap, self.inner_ground, self.outer_ground])


def sample_bands(
    gray: np.ndarray,
    frames: np.ndarray,
    blur: np.ndarray | float,
    angles: np.ndarray,
    family: Family,
    lift: np.ndarray | None = None,
) -> BandSamples:
    """Read the gray values of targets about their dots.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
    blur : float or ndarray of float64, shape (k,)
        Of the edges, standard deviation in px; readings keep away from it.
    angles : ndarray of float64, shape (m,)
        In the frame, from +x towards +y, rad.
    family : Family
    lift : ndarray of float64, shape (k,), optional
        Gray values that black is lifted to.
    """
    inner, outer = family.band_inner, family.band_outer
    beside = beside_edges(frames, blur)
    fixed = np.concatenate(
        [
            inner + (outer - inner) * np.array(_BAND_DEPTHS),
            gap_circles(family),
            np.array(_DOT_RADII),
            [inner, outer],
        ]
    )
    fixed = np.broadcast_to(fixed, (len(frames), len(fixed)))
    radii = np.concatenate([edge_circles(beside, family), fixed], axis=1)
    values = sample_circles(gray, frames, angles, radii)
    values = np.moveaxis(np.maximum(values, 0), 2, 0)
    if lift is not None:
        values = lifted(values, lift[:, None].astype(np.float32))
    ends = np.cumsum([4, len(_BAND_DEPTHS), len(_GAP_DEPTHS), len(_DOT_RADII)])
    across, band, gap, dot, on_edges = np.split(values, ends)
    visible = np.ones((len(frames), len(angles), 2), bool)
    border = np.flatnonzero(near_borders(frames, family, gray.shape))
    limits = frame.circle_points(angles, np.array([inner, outer]) + beside[border])
    visible[border] = within(frame.project(frames[border], limits), gray.shape)
    inner_ground, inner_band, outer_band, outer_ground = across
    return BandSamples(
        inner_ground,
        inner_band,
        outer_band,
        outer_ground,
        band,
        gap,
        dot,
        on_edges,
        beside,
        np.moveaxis(visible, 2, 0),
    )


def beside_edges(frames: np.ndarray, blur: np.ndarray | float) -> np.ndarray:
    """Return the distance of readings beside edges from these, dot radii, shape (k, 1).

    Parameters
    ----------
    frames, blur
        As for `sample_bands`.
    """
    pixels = _BESIDE + _BESIDE_SOFT * np.maximum(blur - _SOFT, 0)
    return np.clip(pixels / frame.mean_radii(frames), _NEAREST, _FARTHEST)[:, None]


def edge_circles(beside: np.ndarray, family: Family) -> np.ndarray:
    """Return the radii at which edges of bands are read, shape (k, 4): in gap, band, band, margin.

    Parameters
    ----------
    beside : ndarray of float64, shape (k, 1)
        Distance from the edges, dot radii.
    family : Family
    """
    inner, outer = family.band_inner, family.band_outer
    return np.array([inner, inner, outer, outer]) + beside * np.array([-1, 1, -1, 1])


def gap_circles(family: Family) -> np.ndarray:
    """Return the radii at which the gap between dot and band is read, shape (2,)."""
    return 1 + (family.band_inner - 1) * np.array(_GAP_DEPTHS)


def near_borders(frames: np.ndarray, family: Family, shape: tuple[int, ...]) -> np.ndarray:
    """Return whether bands may reach beyond an image of shape (height, width), shape (k,)."""
    major, _, _ = frame.ellipse_axes(frames)
    reach = (_PERSPECTIVE * (family.band_outer + _FARTHEST) * major)[:, None]
    centres = frames[:, :2, 2] / frames[:, 2:, 2]
    inside = (centres > reach) & (centres < np.array(shape[1::-1]) - 1 - reach)
    return np.asarray(~inside.all(axis=1))
