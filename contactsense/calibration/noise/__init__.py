"""Noise and model errors of the sensors, estimated from the residuals of a calibration."""
