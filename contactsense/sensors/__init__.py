"""Settings of each sensor, one sample as it arrives, and what can be used of it."""
