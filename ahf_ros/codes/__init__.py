"""Code words of target families: pure arithmetic, no images."""
