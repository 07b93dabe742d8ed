"""The compiled sample path: its state, and the functions that Python calls."""
