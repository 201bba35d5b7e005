"""Families that nobody described, learnt from photographs or coordinates of their targets."""
