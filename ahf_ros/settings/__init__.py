"""Settings that describe themselves."""
