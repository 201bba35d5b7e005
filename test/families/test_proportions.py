"""Prints whose bands are small beside their dots, as where dots have grown more."""

import cv2
import numpy as np

from ahf_ros import identify
from ahf_ros.prints.ring import RingPrint, canonical, family
from support.ring import inked

RADIUS, FINE = 17.0, 4  # of dots, px; rays across a pixel
PAPER, INK = 0.75, 0.05  # reflectances
ASIDE = 1.0  # of the paper beyond bands, dot radii
PROPORTION = 0.955  # of bands, to those of their print


def target(word: int, code: RingPrint) -> np.ndarray:
    """Return the reflectance of a target, shape (n, n), which shows FINE rays in a pixel."""
    side = round(2 * RADIUS * (code.band_outer + ASIDE)) * FINE
    along = (np.arange(side) - (side - 1) / 2) / (RADIUS * FINE)
    x, y = np.meshgrid(along, along)
    of_band = inked(x / PROPORTION, y / PROPORTION, word, code)
    ink = np.where(np.hypot(x, y) < (1 + code.band_inner) / 2, inked(x, y, 0, code), of_band)
    return np.where(ink, INK, PAPER)


def test_a_band_is_read_where_it_is_seen() -> None:
    code = family('cct10')
    words = code.words[20:28]
    tiles = []
    for word in words.tolist():
        fine = target(word, code)
        side = len(fine) // FINE
        tiles.append(fine.reshape(side, FINE, side, FINE).mean(axis=(1, 3)))
    light = cv2.GaussianBlur(np.vstack([np.hstack(tiles[:4]), np.hstack(tiles[4:])]), (0, 0), 0.7)
    noise = np.random.default_rng(0).normal(0, 1.5, light.shape)
    image = np.clip(np.rint(255 * light ** (1 / 2.2) + noise), 0, 255).astype(np.uint8)
    found = identify(image, family=code.name)
    assert sorted(it.id for it in found) == sorted(canonical(words, code)[1].tolist())
