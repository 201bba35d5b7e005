"""Ring targets that the image before showed, read where they are expected.

Their shapes are known better than the dots tell under a pattern of light, whose edges touch them.
The dots tell where these shapes are now, and by how much edges have shifted, so that bands are
read at once in the frames of the printed dots. What is not certain then is read as if nothing were
known of it. Families that are not read were asked when a target was found, and not again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.ring.bands import with_measured_bands
from ahf_ros.families.ring.families import as_described, read_families
from ahf_ros.families.ring.full_size import at_full_size
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import Prior
from ahf_ros.families.ring.proposals import measure_dots
from ahf_ros.families.ring.reading import read_printed
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import ENOUGH, NO_FITS, Fit
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.ellipse_targets import frames_of
from ahf_ros.vision.pyramid import ImagePyramid, Octave, octaves


def read_known(
    pyramid: ImagePyramid,
    settings: DetectorSettings,
    expected: frozenset[int],
    targets: Sequence[Target],
) -> Hypotheses:
    """Return what is read in the places of targets whose families are looked for."""
    families: Sequence[RingPrint] = settings.codes(RingPrint)
    names = np.array([it.family for it in targets], str)
    polarity = np.array([it.polarity for it in targets], int)
    known = Dots(frames_of(targets), polarity, np.ones(len(targets)))
    found = Hypotheses.unread(NO_FITS, families[0])
    for octave in octaves(pyramid, *settings.radii):
        which = _of_octave(octave, known)
        if not which.size:
            continue
        gray = octave.pyramid.gray
        frames = frame.enlarged(known.frames[which], -octave.level)
        dots = measure_dots(gray, replace(known.select(which), frames=frames), covariances=True)
        families = with_measured_bands(gray, dots, families)
        seen = dots.share >= ENOUGH
        if not seen.any():
            continue
        dots, which = dots.select(seen), which[seen]
        printed = _printed(dots, frames[seen])
        prior = Prior.after(expected, found.edge_shift[found.certain] / 2**octave.level)
        read = _read(gray, printed, dots, names[which], families, prior)
        read = at_full_size(pyramid.images[: octave.level + 1], read)
        found = Hypotheses.joined([found, read])
    return as_described(found, settings.codes(RingPrint))


def _of_octave(octave: Octave, known: Dots) -> np.ndarray:
    """Return which dots, in px of the image, an octave is to show, indices."""
    size = frame.mean_radii(known.frames) / 2**octave.level
    low, high = octave.radii
    return np.flatnonzero((size < high) & ((size >= low) | (octave.level == 0)))


def _read(
    gray: np.ndarray,
    printed: Fit,
    dots: Fit,
    names: np.ndarray,
    families: Sequence[RingPrint],
    prior: Prior,
) -> Hypotheses:
    """Return what is read in known frames, or about dots where that leaves a doubt."""
    codes = [code for code in families if code.name in names]
    rest, found = np.ones(len(names), bool), []
    for code in codes:
        own = np.flatnonzero(names == code.name)
        read = read_printed(gray, printed.select(own), code, prior)
        rest[own[read.certain]] = False
        found.append(read.select(read.certain))
    if rest.any():
        dots = measure_dots(gray, dots.select(rest), covariances=True)  # twice, as in a search
        found.append(read_families(gray, dots, codes, prior))
    return Hypotheses.joined(found)


def _printed(dots: Fit, frames: np.ndarray) -> Fit:
    """Return dots in the frames that their prints had, where they are, all edges shifted alike."""
    shift = np.median(dots.polarity * (dots.size - frame.mean_radii(frames)))
    return replace(
        dots,
        frames=frame.centred(frames, dots.frames[:, :2, 2]),
        edge_shift=np.full(len(frames), shift),
        proportion=np.ones(len(frames)),
    )
