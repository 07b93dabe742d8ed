"""Bodies as Python objects: what they are called, their sizes, and which solver belongs to each.

`surface` is their interface; `paper_surfaces`, `rounded_bodies`, `smooth_bodies` and `compound_bodies` are
the bodies.
"""
