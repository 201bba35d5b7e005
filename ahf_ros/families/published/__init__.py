"""Detectors as they were published, to compare with."""
