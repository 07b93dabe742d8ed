"""A simulated arm with sensors, served over the real protocols."""
