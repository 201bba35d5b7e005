"""The share of covers that leave no trace, from the words and the geometry alone.

    python -m benchmarks.traceless [--families metashape12 ...] [--count 20000]

What looks just like paper hides marks without a trace where it ends on ground only, and where the
marks that are left form another word of the family. No identification can tell such a target from
the one that it looks like, unless it is known which IDs there are. A sector counts as covered from
0.9 of its area on, and as free up to 0.1.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.cyclic import smallest_rotation
from ahf_ros.codes.ring import FAMILY_NAMES, Family, canonical, family
from benchmarks import occluders
from benchmarks.exposure import Cell, Occluder

WHITE = 220.0
"""Gray value of paper."""

COVERS: dict[str, Occluder] = {
    'over 1 sector': occluders.over_sectors(1, WHITE),
    'over 2 sectors': occluders.over_sectors(2, WHITE),
    'over 3 sectors': occluders.over_sectors(3, WHITE),
    'over 2 whole sectors': occluders.over_sectors(2, WHITE, whole=True),
    'paper 2.0 dot radii away': occluders.paper(2.0, WHITE),
    'paper 1.4 dot radii away': occluders.paper(1.4, WHITE),
    'finger 2 dot radii wide': occluders.finger(2.0, WHITE),
    'spot of 1 dot radius': occluders.disc(1.0, WHITE),
}
"""What looks like paper, by its name in the table of disturbances."""

_FREE = 0.1  # covered share of a sector that still shows all of it
_DEPTHS, _ANGLES = 12, 12  # places in a sector, across the band and along it


def shares(code: Family, cover: Occluder, count: int, seed: int) -> tuple[float, float]:
    """Return the shares of covered targets that look like another one, and that show every mark.

    Parameters
    ----------
    code : Family
    cover : Occluder
    count : int
        Number of random words and places of the cover.
    seed : int
    """
    generator = np.random.default_rng([seed, 7])
    angles = 2 * np.pi * (np.arange(code.bits * _ANGLES) + 0.5) / (code.bits * _ANGLES)
    depths = code.band_inner + (code.band_outer - code.band_inner) * (
        (np.arange(_DEPTHS) + 0.5) / _DEPTHS
    )
    radii, around = np.meshgrid(depths, angles)
    x, y = (radii * of(around) for of in (np.cos, np.sin))
    cell = Cell(
        x.astype(np.float32),
        y.astype(np.float32),
        0.0,
        code.bits,
        code.band_inner,
        code.band_outer,
        0.03,
    )
    words = generator.choice(code.words, count)
    alike = untouched = 0
    for word in words.tolist():
        covered, _ = cover(cell, generator)
        share = covered.reshape(code.bits, -1).mean(axis=1)
        marked = (word >> np.arange(code.bits) & 1).astype(bool)
        if not (marked & (share > _FREE)).any():
            untouched += 1
        elif not (marked & (share > _FREE) & (share < 1 - _FREE)).any():
            left = int(word & ~np.sum((share >= 1 - _FREE) << np.arange(code.bits)))
            alike += code.number(left) is not None and not _same(word, left, code)
    return alike / count, untouched / count


def far_apart(code: Family, sectors: int, seed: int) -> tuple[int, ...]:
    """Return IDs that cannot look alike, up to a number of sectors of each covered.

    Parameters
    ----------
    code : Family
    sectors : int
        Largest number of neighbouring sectors that are covered.
    seed : int
        Of the order in which IDs are tried.
    """
    windows = [
        sum(1 << (start + step) % code.bits for step in range(count))
        for count in range(sectors + 1)
        for start in range(code.bits)
    ]
    seen: set[int] = set()
    chosen = []
    for index in np.random.default_rng([seed, 8]).permutation(len(code.words)).tolist():
        left = code.words[index] & ~np.array(windows)
        looks = set(smallest_rotation(left, code.bits).tolist())
        if not looks & seen:
            chosen.append(index + 1)
            seen |= looks
    return tuple(sorted(chosen))


def _same(word: int, other: int, code: Family) -> bool:
    ids = canonical(np.array([word, other]), code)[1]
    return bool(ids[0] == ids[1])


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--families', nargs='+', choices=FAMILY_NAMES, default=FAMILY_NAMES)
    parser.add_argument('--count', type=int, default=20_000, help='covers of a row')
    parser.add_argument('--seed', type=int, default=101)
    options = parser.parse_args(arguments)
    print(f'| like paper, without a trace / no mark covered | {" | ".join(options.families)} |')
    print('|---' * (len(options.families) + 1) + '|')
    for name, cover in COVERS.items():
        cells = [
            '{:.1%} / {:.1%}'.format(*shares(family(of), cover, options.count, options.seed))
            for of in options.families
        ]
        print(f'| {name} | {" | ".join(cells)} |')


if __name__ == '__main__':
    main()
