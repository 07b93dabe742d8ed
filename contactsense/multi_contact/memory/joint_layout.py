"""Memory layout of the joint optimization: `LANES` starts at a time, one in each SIMD lane.

The quantities of one contact are in one flat array, as in `contactsense.localization.surface.simd_layout`:
quantity Q of lane j is at index Q + j. Vectors and matrices of unknowns: see
`contactsense.kinematics.linalg.lanes`.
"""

from contactsense.robots.jit.lanes import LANES

(
    PX, PY, PZ, NX, NY, NZ, SX, SY, SZ, TX, TY, TZ, FX, FY, FZ, TORSION, OFFSET, BX, BY, BZ, BNX, BNY, BNZ,
) = range(0, 23 * LANES, LANES)  # fmt: skip
"""Offsets of the iterate: point [m], outward unit normal, two tangents and force [N], base frame; torsion
[Nm] and offset of the real surface [m]; point [m] and normal in the body frame of the primitive."""
ITERATE = 23 * LANES
"""Length of the iterate; after it comes the saved one, at which the matrix was computed."""
(
    R00, R01, R02, R10, R11, R12, R20, R21, R22, OX, OY, OZ, EXTENT, FORCE_PRIOR, MOMENT_PRIOR,
    Z0, Z1, Z2, Z3, Z4, Z5, Z6, Z7, TORSION_STEP, OFFSET_STEP, FRICTION_RATIO, TILT,
    LOG_FORCE, LOG_TAIL, SQUARED_RATIO, PRIOR_ENERGY, W0, W1, W2, W3, W4, W5,
    S00, S01, S02, S11, S12, S22, D0, D1, D2, D3, D4, D5, D6, MOVES,
) = range(2 * ITERATE, 2 * ITERATE + 51 * LANES, LANES)  # fmt: skip
"""Offsets of other quantities of a contact.

`R00` to `OZ`: axes (columns) and origin [m] of the body frame of its primitive. `EXTENT`: information on a
place that the extent of the primitive is [1/m^2]. `FORCE_PRIOR`, `MOMENT_PRIOR`: weights, 0 to 1, of the
priors that all contacts have of normal force and friction ratio, and of torsion ratio and offset. `Z0` to
`Z7`: point [m], force [N], torsion [Nm] and offset [m] minus those known before. `TORSION_STEP`,
`OFFSET_STEP`: torsion [Nm] and offset [m] of one standard deviation of their priors. `FRICTION_RATIO`,
`TILT`: standard deviations of the friction ratio, and of the angle between the normals of surface and
primitive [rad].
`LOG_FORCE`: logarithm of the normal force, relative to the prior's median; `SQUARED_RATIO`: squared friction
ratio in units of its prior; `LOG_TAIL`: log(1 + `SQUARED_RATIO` / nu); `PRIOR_ENERGY`. `W0` to `W5`: wrench
about the base origin. `S00` to `S22`: shape operator, body frame [1/m]. `D0` to `D6`: step in the unknowns;
`MOVES`: whether it is to be taken, 1.0 or 0.0.
"""
JACOBIAN = 2 * ITERATE + 51 * LANES
"""Offset of the derivative of the wrench by the unknowns, six numbers for each."""
PRIOR_MATRIX = JACOBIAN + 42 * LANES
"""Offset of what the priors add to the Gauss-Newton matrix: the lower triangle, row by row."""
PRIOR_GRADIENT = PRIOR_MATRIX + 28 * LANES
"""Offset of what the priors add to the gradient."""
CONTACT_LENGTH = PRIOR_GRADIENT + 7 * LANES
"""Length of the array of a contact."""
(
    ENERGY, TRIAL, CORRECTED, PREDICTED, DECREASE, DAMPING, SCALE, FULL_SCALE, LOG_EVIDENCE,
    ACTIVE, ENDS, SEARCHING, MOVING, VALID,
) = range(14)  # fmt: skip
"""Numbers of each lane. Energies of the iterate and of two trials; predicted and actual decrease; damping;
length of the step, and its largest; log evidence. Flags, 1.0 or 0.0: the optimization goes on; it ends after
the next linearization; no step has been found yet; a step is to be taken; the matrix is positive definite."""
LANE_NUMBERS = 14
"""How many."""
