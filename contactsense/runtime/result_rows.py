"""Candidates as rows of numbers, the form in which the kernels return them."""

LINK, PRIMITIVE, PROBABILITY, TORSION = 0, 1, 2, 3
FIRST_POINT, FIRST_POINT_BASE, FIRST_NORMAL, FIRST_FORCE, FIRST_COVARIANCE = 4, 7, 10, 13, 16
WIDTH = 25
"""Columns of a row: link index; primitive index in the arm; probability; torsion [Nm]; then the first columns
of the point in the frame of the body that carries the link [m], of the point in the base frame [m], of the
normal, of the force [N] and of the covariance of the point [m^2], row by row."""

POINT, POINT_BASE = slice(FIRST_POINT, FIRST_POINT_BASE), slice(FIRST_POINT_BASE, FIRST_NORMAL)
NORMAL, FORCE = slice(FIRST_NORMAL, FIRST_FORCE), slice(FIRST_FORCE, FIRST_COVARIANCE)
COVARIANCE = slice(FIRST_COVARIANCE, WIDTH)
NUMBERS, VECTORS = slice(0, FIRST_POINT), slice(FIRST_POINT, WIDTH)
"""The same columns for Python. `NUMBERS` are the first four, `VECTORS` the seven groups of three that
follow."""
