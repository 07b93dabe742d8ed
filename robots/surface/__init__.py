"""Surfaces of links: the compiled geometry of convex primitives, and how far they are from the real surface.

`convex_primitives`, their `union` and the `signed_distance_grid` of a skin are compiled; `deviation_table` is
what files state of the real surface. `rendering` draws the primitives.
"""
