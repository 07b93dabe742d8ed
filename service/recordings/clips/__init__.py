"""Clips in a folder: what their files are called, what they say, and which repeat the samples of a
recording."""
