"""Ring coded targets (Schneider type).

Throughout, `gray` is an image of gray values from 0 to 255, float32 of shape (height, width);
arrays of k dots or targets have the shape (k, ...), and m is a number of angles. A band is given
by its inner and outer radius. Lengths are in dot radii where no unit is said.
"""
