"""Converts the numbers of the sample path to an `Estimate`."""
