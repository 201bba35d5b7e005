"""Synthetic images of coded targets on a wall, with exact truth, and results against it."""
