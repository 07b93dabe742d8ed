"""Residuals over whole recordings: their size, and how friction differs from the scene's."""
