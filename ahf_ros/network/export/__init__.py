"""Identified targets as other photogrammetric software reads them."""
