"""Adaptive homomorphic filtering; no detector is known here."""
