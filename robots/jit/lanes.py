"""Lanes: how many numbers loops that are vectorized process at a time."""

LANES = 8
"""The number of doubles in the widest vector registers (AVX-512)."""
HALF = LANES // 2
"""Half of them, which fill registers of 256 bits: the compiler prefers these on most processors. Where often
less than half of the lanes are in use, loops leave out the other half."""
