"""Registration of scans in one frame, by the targets that they have in common.

Coordinates are in metres. Nothing here knows ROS, files or images.
"""
