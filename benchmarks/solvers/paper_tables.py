"""Tables 1, 2 and 3 of Bicchi, Salisbury & Brock, "Contact Sensing from Force Measurements" (1993), as
printed.

Misprints of our copy are corrected; each was found by recomputing the tables: Table 1 omits the radius (10
gives every number) and swaps x and y for two of its points; Table 3 prints -0.04 for the force's second
component instead of -0.4, and its first row belongs to c = (-0.598, 0.801, 0.028), not to z = 0.
"""

RADIUS_OF_TABLE_1 = 10.0

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
"""Correct first row of table 3."""

FORCE_OF_TABLE_3 = (-0.3, -0.4, 0.01)

TABLE_3 = {
    # third component of the moment: wrench axis (None: complex), ellipsoid
    0.48: ((-0.60, 0.80, 0.00), (-0.60, 0.80, 0.00)),
    0.49: ((-0.66, 0.75, 0.00), (-0.66, 0.75, 0.04)),
    0.50: (None, (-0.74, 0.67, 0.09)),
    0.51: (None, (-0.76, 0.62, 0.20)),
}

TABLE_2 = {"wrench axis": 232.0, "ellipsoid": 486.0, "iterative step": 473.0}
"""Microseconds on a Motorola 68030; 20 iterative steps to one part in 10^6, with slowly varying input."""

STEPS_OF_TABLE_2 = 20
