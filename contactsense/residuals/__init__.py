"""Residuals: what the sensors measure beyond the arm's own weight, motion and friction."""
