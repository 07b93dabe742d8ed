"""Whether stated probabilities and regions hold what they state."""
