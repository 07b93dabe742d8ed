"""Surface map: what a set of sensors can tell about a push on each place of the arm, from covariances."""
