"""What colours say: the same in overlays, reports and viewers."""

from __future__ import annotations

Colour = tuple[int, int, int]
"""Blue, green, red."""

DECODED_COLOUR: Colour = (60, 230, 60)
"""Of a decoded target."""

DOUBTFUL_COLOUR: Colour = (0, 216, 255)
"""Of a target that is decoded with less confidence than `DOUBTFUL_BELOW`, or not for certain."""

UNDECODED_COLOUR: Colour = (222, 212, 201)
"""Of a dot without a likely code word."""

WRONG_COLOUR: Colour = (60, 60, 255)
"""Of a target that is known to be wrong."""

MISSED_COLOUR: Colour = (0, 130, 255)
"""Of a target that was not identified."""

DECODING_DOT_COLOUR: Colour = (255, 200, 0)
"""Of the dots that are the code of a target that consists of dots."""

TEXT_COLOUR: Colour = (255, 255, 255)
"""Of text that is neither good nor bad."""

OUTLINE_COLOUR: Colour = (0, 0, 0)
"""Around everything that is drawn on an image."""

DOUBTFUL_BELOW = 0.95
"""Confidence below which a decoded target counts as doubtful."""
