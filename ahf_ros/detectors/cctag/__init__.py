"""Concentric circles (CCTag)."""
