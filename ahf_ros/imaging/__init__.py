"""What an image is, and its logarithm."""
