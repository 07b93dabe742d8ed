"""Compilation of all kernels of this project."""
