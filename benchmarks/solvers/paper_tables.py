"""Tables 1, 2 and 3 of Bicchi, Salisbury & Brock, "Contact Sensing from Force Measurements" (1993), as
printed in our copy, and the misprints that recomputing them shows.
"""

from typing import NamedTuple


class Misprint(NamedTuple):
    """What is printed, what is taken instead, and why."""

    printed: str
    taken: str
    reason: str


RADIUS_OF_TABLE_1 = 10.0
"""Inferred: the paper does not state it. From 9.98 to 10.13 at most 3 of the 18 figures differ in their last
digit."""

TABLE_1 = {
    # (friction, delta): c_x by section 5, c'_x by section 4
    (0.1, 0.125): (0.000, 0.005),
    (0.1, 0.25): (0.000, 0.010),
    (0.1, 0.5): (0.000, 0.020),
    (0.7, 0.125): (0.000, 0.164),
    (0.7, 0.25): (0.005, 0.329),
    (0.7, 0.5): (0.039, 0.658),
    (1.0, 0.125): (0.001, 0.250),
    (1.0, 0.25): (0.010, 0.500),
    (1.0, 0.5): (0.077, 1.000),
}

CORRECTED = {0.48: (-0.598, 0.801, 0.028)}
"""Correct contact centroid of the first row of table 3."""

FORCE_OF_TABLE_3 = (-0.3, -0.4, 0.01)
PRINTED_FORCE_OF_TABLE_3 = (-0.3, -0.04, 0.01)

TABLE_3 = {
    # third component of the moment: wrench axis (None: complex), ellipsoid, iterative
    0.48: ((-0.60, 0.80, 0.00), (-0.60, 0.80, 0.00), (-0.60, 0.80, 0.00)),
    0.49: ((-0.66, 0.75, 0.00), (-0.66, 0.75, 0.04), (-0.66, 0.75, 0.04)),
    0.50: (None, (-0.74, 0.67, 0.09), (-0.73, 0.68, 0.07)),
    0.51: (None, (-0.76, 0.62, 0.20), (-0.76, 0.62, 0.20)),
}

TABLE_2 = {"wrench axis": 232.0, "ellipsoid": 486.0, "iterative step": 473.0}
"""Microseconds on a Motorola 68030; 20 iterative steps to one part in 10^6, with slowly varying input."""

STEPS_OF_TABLE_2 = 20

MISPRINTS = {
    "Table 1": (
        Misprint(
            "no radius",
            "10, inferred",
            "with it 15 of the 18 figures agree when rounded; the other three, all of the ellipsoid method, "
            "agree when cut off after the third decimal",
        ),
        Misprint(
            "all four points on the x axis, at +-delta and +-8 delta",
            "c_2 and c_4 at +-8 delta on the y axis",
            "on the x axis all of them have x = 0, by either method",
        ),
    ),
    "Table 3": (
        Misprint(
            "f_2 = -0.04",
            "-0.4",
            "with -0.04 the line of action passes the sphere at 1.6 to 1.7 radii in all rows, and none of "
            "the printed points is a contact",
        ),
        Misprint(
            "z = 0.00 in the first row, by all methods",
            "0.03",
            "it is the point of the wrench axis; its neighbours in the rows below have z = 0.04 to 0.20",
        ),
        Misprint(
            "iterative, third row: (-0.73, 0.68, 0.07)",
            "the ellipsoid method's",
            "both methods solve the same equations; the iteration had not converged",
        ),
        Misprint(
            "noise on the second component of the moment (caption)",
            "on the third",
            "the third component differs between the rows",
        ),
    ),
}
"""For each table; each reason is tested."""
