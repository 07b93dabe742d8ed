"""How primitives are fitted to the skin of a link; needs the `geometry` extra, and is not needed to run."""
