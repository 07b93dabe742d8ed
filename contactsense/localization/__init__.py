"""Localization: the point on the surface of each link at which a wrench acts, and its probability."""
