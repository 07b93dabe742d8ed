"""Candidates as rows of numbers, the form in which the kernels return them."""

LINK, PRIMITIVE, PROBABILITY, TORSION = 0, 1, 2, 3
POINT, POINT_BASE, NORMAL, FORCE = slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)
COVARIANCE = slice(16, 25)
NUMBERS, VECTORS = slice(0, 4), slice(4, 25)
WIDTH = 25
"""Columns of a row: link index; primitive index in the arm; probability; torsion [Nm]; point in the frame of
the body that carries the link [m]; point in the base frame [m]; normal; force [N]; covariance of the point
[m^2]. `NUMBERS` are the first four columns, `VECTORS` the seven groups of three that follow."""
