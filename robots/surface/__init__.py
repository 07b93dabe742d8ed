"""Compiled geometry of link surfaces: convex primitives, their union, signed-distance grids."""
