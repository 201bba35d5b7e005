"""Orientation of photographs and coordinates of targets, from identified targets alone.

`network` holds what was observed, `solution` what was computed from it. Neither knows an image nor
a detector: an observation is a photograph, an ID, a place and its covariance.
"""
