"""Localization: the point on the surface of each link at which a wrench acts, and its probability.

`ranking` calls the search of each link and compares all candidates. Where the line of action is known, the
search is that of `line_search`: one posterior mode on every primitive near the line. Where it is not, it is
`surface_search`: evidence of all cells of the surface, and clusters of them as candidates. Both are given a
`problem`, use the `surface` of the arm in one posture, and fill `candidates`. `unmodelled_places` adds what
the primitives do not model. `intrinsic_contact` is the paper's closed form instead.
"""
