"""Whether targets look like the print of their words, where light is even about them.

Where the ground beyond a band is even, and its light makes ink as dark as the dot is, the light on
the target is even, and all of it is paper or ink. What covers a target without reaching beyond it
hides a small part of its directions. A print with other radii or with two bands is another one
nearly all round.
"""

from __future__ import annotations

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.ring.decoding import Words
from ahf_ros.families.ring.light import clear_of
from ahf_ros.families.ring.polar import LIGHT_EDGE, SOFT_EDGE, PolarImages, angles_of
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.robust import fit_linear

_MINIMUM_ASIDE = 1.0  # distance from an edge at which it ends, px
_INMOST = 0.5  # of the dot, whose ink is that of marks where light is even, dot radii
_BEYOND = 0.2, 0.7  # the ground beyond a band, dot radii
_ASIDE = 0.25  # distance from further circles, dot radii
_EVEN, _UNEVEN = 0.3, 0.03  # of the step of ink that even paper keeps within; share that may not
_UNLIKE = 0.5  # of that step, up to which ink is paper
_DEEPER = 2.0  # steps of ink, up to which a dot is darker than its soft edge
_READINGS = 2  # in one direction, which are no noise
_OF_MARKS = 1 / 3  # of all sectors, that are as unlike as all marks


def unlike_print(
    polar: PolarImages, words: Words, growth: np.ndarray, overhang: np.ndarray, family: RingPrint
) -> np.ndarray:
    """Return the shares of sectors in which targets are not what their words print, (k,).

    Of a sector, the directions away from its borders count that differ at one radius, as circles
    of another print do and scratches do not. Where few are marked, a third of the share of these
    counts. All are NaN where light is uneven, which tells nothing of print.
    `growth`, shape (k,), is that of ink in dot radii, and `overhang` by how many angles this makes
    arcs longer at either end.
    """
    count, (inner, outer) = words.hidden.shape[1], family.band
    dot, inside, outside = growth, inner - growth, outer + growth
    aside = np.maximum(SOFT_EDGE * polar.blur, _MINIMUM_ASIDE) / polar.size
    beyond = outside + np.maximum(aside, _BEYOND[0]), outside + _BEYOND[1]
    gap, deep = (1 + dot + aside, inside - aside), (inside + aside, outside - aside)
    near = inside - aside, outside + aside
    phases = np.rint(words.starts * count / (2 * np.pi)).astype(int)
    away = aside * count / (np.pi * (inner + outer)) + 1
    longer = np.rint([overhang - away, overhang + away]).astype(int)
    radii, angles = polar.radii[0], angles_of(count)
    clear = clear_of(radii, family.circles, _ASIDE)
    light = _light_on(polar, np.where(clear, radii, np.inf), *beyond)
    paper = np.maximum(np.exp(light[:, :1]) - LOG_OFFSET, 0)
    step = np.log(polar.inked(paper, paper) + LOG_OFFSET) - light[:, :1]
    return kernels.unlike_shares(
        *(polar.gray, polar.row, light, step[:, 0], radii, clear, polar.reach),
        *(np.array([np.cos(angles), np.sin(angles)]), words.words, phases, longer),
        np.array([beyond, gap, deep, near]).transpose(2, 0, 1),
        *(LOG_OFFSET, _EVEN, _UNEVEN, _INMOST, _DEEPER, _UNLIKE, _READINGS, _OF_MARKS),
        n=family.bits,
    )[0]


def _light_on(
    polar: PolarImages, radii: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Return the planes in ln of the light that ground between radii (k,) shows, (k, 3).

    A lamp nearby makes light like this. The radii of circles are (n,).
    """
    beyond: np.ndarray = (radii > low[:, None]) & (radii < high[:, None])
    used = np.asarray(beyond.any(axis=0))
    used[-1] = True  # blur may leave none
    some = np.flatnonzero(used)
    seen = polar.levels(polar.gray[polar.row[:, None], some])
    known = beyond[:, some, None] & (radii[some, None] <= polar.reach[:, None])
    angles, at = angles_of(seen.shape[2]), polar.radii[0, some, None]
    plane = [np.ones(seen.shape[1:]), at * np.cos(angles), at * np.sin(angles)]
    values, weights = (of.reshape(len(seen), -1).astype(float) for of in (seen, known))
    return fit_linear(values, weights, np.reshape(plane, (3, -1)).T, LIGHT_EDGE)[0]
