"""Point clouds: positions of targets in them, and scans in one frame."""
