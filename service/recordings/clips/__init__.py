"""Clips in a folder: names and contents of their files, and which repeat the samples of a recording."""
