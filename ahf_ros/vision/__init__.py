"""Images, and finding and measuring targets of any family in them; no family is known here."""

MAXIMUM_IMAGES = 64
"""Maximum number of images of a stack."""
