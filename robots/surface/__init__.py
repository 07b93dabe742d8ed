"""Surfaces of links: convex primitives as data, and their compiled geometry.

`primitives` and `deviation_table` are what files state; `convex_primitives`, their `union` and the
`signed_distance_grid` of a skin are compiled. `rendering` draws them.
"""
