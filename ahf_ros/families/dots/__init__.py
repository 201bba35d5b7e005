"""Rings of dots: a disc, small dots round it that are the code, and a border about them."""
