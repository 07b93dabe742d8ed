"""The fit of the parameters, and their covariance.

`gauss_newton` repeats a `robust_least_squares` step for what the motion determines (`identifiability`),
within inertia that bodies can have (`possible_bodies`). `sandwich_covariance` allows for slow model errors,
by the `residual_autocovariance`.
"""
