"""Hypotheses on the dots of an image: where they are, and what their bands were read as."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.families.ring.decoding import Words
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.circle_fit import Fit
from ahf_ros.vision.growth import growth_in_light

CERTAIN = 0.75
"""Confidence from which words are reported."""

_IN_PLACE, _EXACT = 0.6, 0.5  # edges of a print: least share of them, largest deviation, px
_CLEAR = 5.0  # log odds of a word against arcs of any length, up to which others may be right


@dataclass(frozen=True, slots=True)
class Hypotheses(ArrayRecord):
    """k dots, and what their bands were read as.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        In px of the image.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that were measured where they are expected.
    deviation : ndarray of float64, shape (k,)
        Standard deviation of these edges, dot radii.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px of the image that they were measured in.
    edge_shift : ndarray of float64, shape (k,)
        By how much dark gray values have grown on all edges, px of that image.
    contrast : ndarray of float64, shape (k,)
        Usual gray value of the dark side of edges over the bright side's.
    polarity : ndarray of int, shape (k,)
        1 for a dark target on bright ground, -1 for a bright one on dark.
    words : ndarray of int64, shape (k,)
        In the rotation read; 0 where there is none.
    starts : ndarray of float64, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    margin, marked, coded, seen, typical, unlike, outer : ndarray of float64, shape (k,)
        Log odds of the word and looks of its print, see `ahf_ros.families.ring.decoding.Words`.
    hidden : ndarray of float64, shape (k,)
        Share of the band that something covers.
    families : ndarray of Family, shape (k,)
        Those of the words.
    confidence : ndarray of float64, shape (k,)
        Probability that the word is right.
    """

    frames: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    deviation: np.ndarray
    blur: np.ndarray
    edge_shift: np.ndarray
    contrast: np.ndarray
    polarity: np.ndarray
    words: np.ndarray
    starts: np.ndarray
    margin: np.ndarray
    marked: np.ndarray
    coded: np.ndarray
    seen: np.ndarray
    typical: np.ndarray
    unlike: np.ndarray
    outer: np.ndarray
    hidden: np.ndarray
    families: np.ndarray
    confidence: np.ndarray

    @property
    def certain(self) -> np.ndarray:
        """Whether words are certain enough to be reported, ndarray of bool, shape (k,)."""
        return self.confidence >= CERTAIN

    @property
    def clear(self) -> np.ndarray:
        """Whether no other family may explain the bands of certain words better, shape (k,)."""
        return self.certain & (self.coded > _CLEAR)

    @property
    def in_place(self) -> np.ndarray:
        """Whether enough edges are where those of a print are, ndarray of bool, shape (k,)."""
        return np.asarray(self.share >= _IN_PLACE)

    @property
    def exact(self) -> np.ndarray:
        """Whether edges are ellipses, ndarray of bool, shape (k,).

        Light makes dots of its edges, too, which are mostly much larger and little like ellipses.
        """
        return np.asarray(self.deviation * frame.mean_radii(self.frames) < _EXACT)

    @property
    def print_growth(self) -> np.ndarray:
        """Growth of what is dark in light, px, (k,); NaN where no word was read."""
        shift = np.where(self.words > 0, self.edge_shift, np.nan)
        return growth_in_light(shift, self.blur, self.contrast)

    @property
    def reach(self) -> np.ndarray:
        """Radii of the targets with their bands, px, ndarray of float64, shape (k,)."""
        _, minor, _ = frame.ellipse_axes(self.frames)
        return minor * np.array([code.band_outer for code in self.families])

    def on_dots(self, frames: np.ndarray) -> np.ndarray:
        """Return whether centres lie on dots with frames (n, 3, 3), ndarray of bool, (k,)."""
        away = self.frames[:, None, :2, 2] - frames[:, :2, 2]
        near = np.hypot(away[..., 0], away[..., 1]) < frame.mean_radii(frames)
        return np.asarray(near.any(axis=1))

    @staticmethod
    def of(fit: Fit, words: Words, family: RingPrint) -> Hypotheses:
        """Return words and the frames that were fitted to them, not rated yet."""
        return Hypotheses(
            frames=fit.frames,
            covariance=fit.covariance,
            share=fit.share,
            deviation=fit.deviation / fit.size,
            blur=fit.blur,
            edge_shift=fit.edge_shift,
            contrast=fit.contrast,
            polarity=fit.polarity,
            words=words.words,
            starts=words.starts,
            margin=words.margin,
            marked=words.marked,
            coded=words.coded,
            seen=words.seen,
            typical=words.typical,
            unlike=words.unlike,
            outer=words.outer,
            hidden=words.hidden.mean(axis=1),
            families=np.full(len(words.words), family, object),
            confidence=np.zeros(len(words.words)),
        )

    @staticmethod
    def unread(dots: Fit, family: RingPrint) -> Hypotheses:
        """Return dots without words."""
        return Hypotheses.of(dots, Words.none(len(dots.frames)), family)
