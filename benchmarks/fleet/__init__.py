"""A simulated year of a fleet: generated, analysed, and compared with the ground truth."""
