"""Adaptive homomorphic filtering, for any detector."""
