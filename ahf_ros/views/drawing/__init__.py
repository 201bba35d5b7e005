"""Overlays of what was identified, and pictures side by side."""
