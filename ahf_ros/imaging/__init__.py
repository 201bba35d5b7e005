"""Images and their logarithms; here the limit that settings state before any image is there."""

MAXIMUM_IMAGES = 64
"""Maximum number of images of a stack."""
