"""What a scene says, as numbers: the arrays that samples do not change, sensor frames, and weights."""
