"""Square markers (ArUco, AprilTag)."""
