"""The static ground truth: contacts on an arm at rest, with the noise and the sensors of each case."""
