"""What is known of an image while its targets are read.

Certain targets and whole dots explain edges, so that no dots are looked for there, and tell how
edges have shifted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.families.ring.circles import REACH
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.dots import NO_DOTS, Dots
from ahf_ros.vision.log_edges import mask_of
from ahf_ros.vision.pyramid import MAXIMUM_RADIUS, Octave
from ahf_ros.vision.robust import NORMAL
from ahf_ros.vision.shape_votes import dots_in_shapes

WHOLE = 0.9
"""Share of the edge of a dot that is explained, or reported, without a word."""

_AROUND = 0.25  # a whole dot without a word, where its own edge lies, dot radii
_USUAL_DEVIATION = 1.0  # of the shift of edges of images, px
_MINIMUM_DEVIATION = 0.3  # of targets of one image, which are not lit and printed alike, px
_MINIMUM_TARGETS = 3  # certain targets that tell the shift of an image, and the shape of others


@dataclass(frozen=True, slots=True)
class Explained(ArrayRecord):
    """k certain targets and whole dots, whose edges need no other explanation.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        In px of the image.
    outlines : ndarray of float64, shape (k, m, 2)
        Polygons around them and their margins, px of the image.
    sizes : ndarray of float64, shape (k,)
        Smaller radii of these, px.
    polarity : ndarray of int, shape (k,)
        1 for a dark target on bright ground, -1 for a bright one on dark.
    certain, clear : ndarray of bool, shape (k,)
        Whether they are targets, and of no other family than the one read.
    shifts : ndarray of float64, shape (k,)
        Of their edges, px of the image; see `Hypotheses.edge_shift`.
    """

    frames: np.ndarray
    outlines: np.ndarray
    sizes: np.ndarray
    polarity: np.ndarray
    certain: np.ndarray
    clear: np.ndarray
    shifts: np.ndarray

    @staticmethod
    def by(read: Hypotheses) -> Explained:
        """Return what hypotheses explain, those of a whole image."""
        certain = read.certain
        explained = certain | (read.share >= WHOLE)
        read, certain = read.select(explained), certain[explained]
        _, minor, _ = frame.ellipse_axes(read.frames)
        radii = np.where(certain, read.reach / minor + REACH, 1.0 + _AROUND)
        outlines = frame.circle_outlines(read.frames, radii)
        return Explained(
            read.frames,
            outlines,
            radii * minor,
            read.polarity,
            certain,
            read.clear,
            read.edge_shift,
        )

    def moved(self, x: float, y: float) -> Explained:
        """Return the same in the pixels of an image that shows (0, 0) at (x, y)."""
        frames = frame.translated(self.frames, x, y)
        return replace(self, frames=frames, outlines=self.outlines + np.array([x, y]))

    def on_them(self, frames: np.ndarray, level: int) -> np.ndarray:
        """Return whether dots lie on these, (n,), in the image halved `level` times."""
        centres = frame.enlarged(frames, level)[:, None, :2, 2]
        away = centres - self.frames[:, :2, 2]
        near = np.hypot(away[..., 0], away[..., 1]) < self.sizes
        return np.asarray(near.any(axis=1))

    def alike(self, octave: Octave) -> Dots:
        """Return the dots of an octave in the shapes of the certain targets about them.

        An edge of light that touches a dot is taken for a part of its own and makes another
        ellipse of it; targets of one image that are close to each other have much the same.
        """
        found = [NO_DOTS]
        size = frame.mean_radii(self.frames) / 2**octave.level
        low, high = octave.radii
        of_octave = self.select(self.certain & (size >= low) & (size <= high))
        for polarity in (1, -1):
            known = of_octave.select(of_octave.polarity == polarity)
            if len(known.frames) < _MINIMUM_TARGETS:
                continue
            radii = frame.mean_radii(known.frames)
            grown = 1 + polarity * known.shifts / radii
            usual = float(np.median(radii)) / 2**octave.level / MAXIMUM_RADIUS
            half = int(np.clip(np.ceil(np.log2(usual)), 1, len(octave.pyramid.edges)))
            edges = octave.pyramid.edges[half - 1]
            mask = mask_of(self.outlines_in(octave.level + half), edges.marked.shape)
            frames = frame.enlarged(frame.scaled(known.frames, grown), -octave.level - half)
            dots = dots_in_shapes(edges.unmasked(mask), frames, polarity)
            found.append(replace(dots, frames=frame.enlarged(dots.frames, half)))
        return Dots.joined(found)

    def outlines_in(self, level: int) -> np.ndarray:
        """Return the outlines with edges in the image that is halved `level` times, its px."""
        return frame.reduced(self.outlines[self.sizes > 2**level], level)


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known before a target is read.

    Attributes
    ----------
    expected : frozenset of int
        IDs that are likely to be there. Empty: all IDs are equally likely.
    shift, deviation : float
        By how much what is dark has probably grown on all edges, and its standard deviation, px.
    """

    expected: frozenset[int] = frozenset()
    shift: float = 0.0
    deviation: float = _USUAL_DEVIATION

    @staticmethod
    def after(expected: frozenset[int], shifts: np.ndarray) -> Prior:
        """Return what is known once certain targets show shifts of edges, shape (k,), px."""
        if len(shifts) < _MINIMUM_TARGETS:
            return Prior(expected)
        shift = float(np.median(shifts))
        spread = NORMAL * float(np.median(np.abs(shifts - shift)))
        return Prior(expected, shift, float(np.clip(spread, _MINIMUM_DEVIATION, _USUAL_DEVIATION)))


NOTHING_KNOWN = Prior()
"""That of an image of which no target was read yet."""
