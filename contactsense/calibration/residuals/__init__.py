"""Residuals of recordings and their derivatives by the parameters, as equations for least squares.

`recording_residuals` are those of the joints and the base sensor, with the Jacobian of `residual_jacobian`;
`link_residuals` those of the sensors within the arm. `equations` joins them.
"""
