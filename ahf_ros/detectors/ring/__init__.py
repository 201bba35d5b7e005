"""Ring coded targets (Schneider type)."""
