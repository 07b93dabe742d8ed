"""The exact contact on any smooth convex body that is a level set, by iteration.

`general` is the whole method: from the `initial_guess`, contacts on `osculating` ellipsoids; where these do
not converge, `newton`, and the `ellipsoid_method` for what remains. `level_set` evaluates the body of
`implicit_surfaces` at a point. `gradient_descent` is the paper's iteration, for comparison.
"""
