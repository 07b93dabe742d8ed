"""The compiled sample path: constants, state, and the functions that Python calls."""
