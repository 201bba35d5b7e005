"""Images and their logarithms."""
