"""The exact contact on any smooth convex body that is a level set, by iteration.

`general` is the whole method: `initial_guess`, then `newton`, with `osculating` where it starts and
`ellipsoid_method` where it fails. `level_set` evaluates the body of `implicit_surfaces` at a point.
`gradient_descent` is the paper's Iterative method, for comparison.
"""
