"""The lights that benchmarks and fits look at.

They are listed by name: a light that is added to the package changes no figure.
"""

PATTERNS = (
    'stripe',
    'wide_stripe',
    'fine_stripe',
    'diagonal_stripe',
    'lattice',
    'dense_lattice',
    'fringe',
    'spots',
    'shadow',
)
"""Lights that are projected or that hide something."""

EVERY_LIGHT = ('normal', *PATTERNS)
"""These and even light."""

LIT = (('normal', 0.3), *((name, ambient) for name in PATTERNS for ambient in (0.3, 0.12, 0.04)))
"""Lights of the benchmarks, each with the share of light that is ambient."""
