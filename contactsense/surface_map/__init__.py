"""Surface map: what a set of sensors can determine about a push on each place of the arm."""
