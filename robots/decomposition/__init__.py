"""Fitting of primitives to the skin of a link; needs the `geometry` extra, and is not needed at run time."""
