"""Square markers: ArUco and AprilTag."""
