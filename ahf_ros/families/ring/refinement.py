"""Sub-pixel centres in the image as received of targets that were found in a filtered image.

A filter that makes targets readable also moves their edges, because it changes the gray values on
one side of an edge by those on the other. IDs may come from a filtered image, centres should not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families.ring.bands import with_measured_bands
from ahf_ros.families.ring.circles import RAYS, REACH
from ahf_ros.families.ring.full_size import with_soft_edges
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import Prior
from ahf_ros.families.ring.reading import read_bands
from ahf_ros.prints.ring import RingPrint, canonical
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import ENOUGH, Fit, fit_dots
from ahf_ros.vision.ellipse_targets import ellipse_fields, frames_of, stayed
from ahf_ros.vision.image import as_gray, check_image


def refine_centres(
    image: np.ndarray,
    targets: Sequence[Target],
    families: Sequence[RingPrint],
    polarities: Sequence[int] = (1, -1),
    expected: frozenset[int] = frozenset(),
) -> list[Target]:
    """Return targets with centres, ellipses and covariances from the edges in an image.

    Where the band of a target can be read and agrees with `Target.code`, dot and band together
    give the image of the physical centre. Elsewhere the dot gives the centre of its ellipse. A
    target without an edge near its ellipse is returned unchanged. No ID and no place in the list
    changes.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        The image as received; `ValueError` if it is none, see `check_image`.
    targets : sequence of Target
        To about a pixel.
    families : sequence of Family
        Those of the targets; the first one of the targets that do not say theirs.
    polarities : sequence of int
        Those to be expected: 1 for a dark dot on bright ground, -1 for a bright one on dark.
    expected : frozenset of int
        IDs that are likely to be there. Empty: all IDs are equally likely.
    """
    check_image(image)
    if not targets:
        return []
    gray = as_gray(image).astype(np.float32, copy=False)
    start = frames_of(targets)
    located = _locate(gray, start, targets, families, polarities, expected)
    good = (located.share >= ENOUGH) & stayed(located.frames, start)
    places = ellipse_fields(located.frames, located.covariance, located.print_growth)
    return [
        replace(target, **place) if is_good else target
        for target, place, is_good in zip(targets, places, good, strict=True)
    ]


def _locate(
    gray: np.ndarray,
    start: np.ndarray,
    targets: Sequence[Target],
    families: Sequence[RingPrint],
    polarities: Sequence[int],
    expected: frozenset[int],
) -> Hypotheses:
    """Return targets, by dot and band where the band agrees, else by the dot."""
    dots = _fit_either_polarity(gray, start, polarities)
    decoded = np.flatnonzero(
        [target.id != UNDECODED for target in targets] & (dots.share >= ENOUGH)
    )
    hypotheses, which = _agreeing(gray, dots, decoded, targets, families, expected)
    # Of two hypotheses on one target, the one with the larger margin comes first.
    order = np.argsort(-hypotheses.seen, kind='stable')
    by_band, best = np.unique(which[order], return_index=True)
    rest = np.setdiff1d(np.arange(len(targets)), by_band)
    alone = fit_dots(gray, start[rest], dots.polarity[rest], rays=RAYS, reach=REACH)
    located = Hypotheses.unread(dots, families[0])
    located = located.replaced(rest, Hypotheses.unread(alone, families[0]))
    return located.replaced(by_band, hypotheses.select(order[best]))


def _agreeing(
    gray: np.ndarray,
    dots: Fit,
    decoded: np.ndarray,
    targets: Sequence[Target],
    families: Sequence[RingPrint],
    expected: frozenset[int],
) -> tuple[Hypotheses, np.ndarray]:
    """Return readings that agree with the codes of targets, and the target that each is of."""
    codes = np.array([target.code for target in targets])
    known = {code.name: code for code in families}
    names = np.array([it.family if it.family in known else families[0].name for it in targets])
    parts, of_parts = [], []
    for name in dict.fromkeys(names[decoded].tolist() or [families[0].name]):
        of_family = decoded[names[decoded] == name]
        some = dots.select(of_family)
        (code,) = with_measured_bands(gray, some, [known[name]])
        read = read_bands(gray, some, code, Prior(expected))
        which = of_family
        agreed = (read.words > 0) & (canonical(read.words, code)[0] == codes[which])
        agreed &= read.share >= ENOUGH
        parts.append(with_soft_edges(gray, read, agreed).select(agreed))
        of_parts.append(which[agreed])
    return Hypotheses.joined(parts), np.concatenate(of_parts)


def _fit_either_polarity(gray: np.ndarray, frames: np.ndarray, polarities: Sequence[int]) -> Fit:
    """Return first fits of dots, each with the polarity that its edge has."""
    count = len(frames)
    fits = [
        fit_dots(gray, frames, np.full(count, polarity), rays=RAYS // 2, reach=REACH, rounds=1)
        for polarity in polarities
    ]
    # Flat parts show edges of the wrong polarity, too, but these are faint. Those within a bright
    # dot on black are not, but of another size.
    sizes = [frame.ellipse_axes(fit.frames)[0] / frame.ellipse_axes(frames)[0] for fit in fits]
    alike = [np.minimum(size, 1 / np.maximum(size, 1e-9)) for size in sizes]
    seen = [fit.share * (1 - fit.contrast) for fit in fits]
    best = np.argmax(np.multiply(seen, alike), axis=0)
    return Fit.joined(fits).select(best * count + np.arange(count))
