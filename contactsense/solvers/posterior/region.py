"""Size of the region of places that the covariance of a contact states."""

import math

REGION_90 = -2.0 * math.log(0.1)
"""Squared Mahalanobis distance within which a normal distribution in two dimensions has 90 % of its mass."""
