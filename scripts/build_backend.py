"""The build backend of pip: setuptools', which needs a compiler from PyPI if there is no other."""

from __future__ import annotations

from build_kernels import TARGETS, ZIG, own_compiler
from setuptools import build_meta as _setuptools
from setuptools.build_meta import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    'build_editable',
    'build_sdist',
    'build_wheel',
    'get_requires_for_build_editable',
    'get_requires_for_build_sdist',
    'get_requires_for_build_wheel',
    'prepare_metadata_for_build_editable',
    'prepare_metadata_for_build_wheel',
]


def get_requires_for_build_wheel(config_settings: dict[str, str] | None = None) -> list[str]:
    """Return what building a wheel needs."""
    needed = _setuptools.get_requires_for_build_wheel(config_settings)
    elsewhere = any(name in str(config_settings) for name in TARGETS)
    return needed if own_compiler() and not elsewhere else [*needed, ZIG]


def get_requires_for_build_editable(config_settings: dict[str, str] | None = None) -> list[str]:
    """Return what building an editable installation needs."""
    needed = _setuptools.get_requires_for_build_editable(config_settings)
    return needed if own_compiler() else [*needed, ZIG]
