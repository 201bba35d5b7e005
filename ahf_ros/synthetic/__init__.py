"""Images of walls of targets whose truth is known exactly."""
