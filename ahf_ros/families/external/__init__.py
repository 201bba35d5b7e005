"""Detectors that are not part of this package."""
