"""Lanes: how many numbers loops that are vectorized process at a time."""

LANES = 8
"""The number of doubles in the widest vector registers (AVX-512)."""
