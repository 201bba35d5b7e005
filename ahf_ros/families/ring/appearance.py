"""Whether targets look like the print of their words, where light is even about them.

Where the ground beyond a band is even, and its light makes ink as dark as the dot is, the light on
the target is even, and all of it is paper or ink. What covers a target without reaching beyond it
hides a small part of its directions. A print with other radii or with two bands is another one
nearly all round.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.families.ring.decoding import Words, bits_at, lengthened
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
    (number, count), (inner, outer) = words.hidden.shape, family.band
    radii, about = polar.radii, (growth, inner - growth, outer + growth)
    dot, inside, outside = (of[:, None] for of in about)
    aside = (np.maximum(SOFT_EDGE * polar.blur, _MINIMUM_ASIDE) / polar.size)[:, None]
    clear = clear_of(radii, family.circles, _ASIDE)
    beyond = (radii > outside + np.maximum(aside, _BEYOND[0])) & (radii < outside + _BEYOND[1])
    gap = (radii > 1 + dot + aside) & (radii < inside - aside)
    deep = (radii > inside + aside) & (radii < outside - aside)
    near = (radii > inside - aside) & (radii < outside + aside)
    visible = (radii[:, None] <= polar.reach[..., None]) & clear[:, None]
    phases = np.rint(words.starts * count / (2 * np.pi)).astype(int)
    marked = bits_at(words.words, phases, count // family.bits, family)
    away = aside[:, 0] * count / (np.pi * (inner + outer)) + 1
    inked = lengthened(marked, overhang - away)
    ink = inked[..., None] & deep[:, None] & visible
    unmarked = ~lengthened(marked, overhang + away)
    paper = ((gap | beyond)[:, None] | (unmarked[..., None] & near[:, None])) & visible
    ground = np.broadcast_to(beyond[:, None] & visible, (*polar.reach.shape, radii.shape[1]))
    step = _step_shares(polar, ground)
    uneven = (np.abs(step) > _EVEN) & ground
    even = uneven.sum(axis=(1, 2)) < _UNEVEN * ground.sum(axis=(1, 2))
    of_dot = step[..., (radii < _INMOST).all(axis=0)].mean(axis=(1, 2))
    even &= (of_dot > 1 - _EVEN) & (of_dot < _DEEPER)
    faded, stray = ink & (step < _UNLIKE), paper & (step > _EVEN)
    lost = np.count_nonzero(faded, axis=2) >= _READINGS
    printed = np.maximum(np.count_nonzero(ink.any(axis=2), axis=1), 1)
    of_marks = np.count_nonzero(lost, axis=1) / printed
    odd = faded | stray
    odd[..., 1:] &= odd[..., :-1]  # noise is of one reading
    told = inked | unmarked
    places = (phases[:, None] + np.arange(count)) % count
    sectors = number, family.bits, count // family.bits
    differ = np.take_along_axis(odd & told[..., None], places[..., None], axis=1)
    of_told = np.take_along_axis(told, places, axis=1).reshape(sectors).sum(axis=2)
    at_radius = differ.reshape(*sectors, -1).sum(axis=2) / np.maximum(of_told, 1)[..., None]
    of_sectors = at_radius.max(axis=2)
    unlike = np.maximum(of_sectors.mean(axis=1), _OF_MARKS * of_marks)
    return np.where(even, unlike, np.nan)


def _step_shares(polar: PolarImages, ground: np.ndarray) -> np.ndarray:
    """Return steps of ln from the light that ground shows, in those of ink, (k, m, n).

    That light is a plane in ln, as a lamp nearby makes it.
    """
    values = np.log(polar.gray[polar.row].swapaxes(1, 2) + np.float32(LOG_OFFSET))
    angles, radii = angles_of(ground.shape[1])[:, None], polar.radii[0]
    plane = np.stack([np.ones(ground.shape[1:]), *(radii * of(angles) for of in (np.cos, np.sin))])
    beyond = np.asarray(ground.any(axis=(0, 1)))
    beyond[-1] = True  # blur may leave none
    seen, known, basis = (
        of[..., beyond].reshape(len(of), -1).astype(float) for of in (values, ground, plane)
    )
    light, _ = fit_linear(seen, known, basis.T, LIGHT_EDGE)
    of_paper = np.tensordot(light, plane, axes=1)
    paper = np.maximum(np.exp(light[:, :1]) - LOG_OFFSET, 0)
    step = np.log(polar.inked(paper, paper) + LOG_OFFSET) - light[:, :1]
    return (values - of_paper) / np.where(step == 0, np.inf, step)[..., None]
