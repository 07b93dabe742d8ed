"""Calibration on simulated recordings whose truth is known."""
