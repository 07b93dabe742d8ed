"""Memory layout of a block of primitives on each of which a contact is searched for, one primitive in each
lane of the processor's vector registers.

A block is one flat array in which every quantity has `LANES` consecutive numbers: quantity Q of lane j is at
index Q + j.
"""

from contactsense.robots.jit.lanes import LANES

(
    P0, P1, P2, P3, P4, P5, P6, RADIUS,
    R00, R01, R02, R10, R11, R12, R20, R21, R22, OX, OY, OZ,
    W0, W1, W2, W3, W4, W5,
    F00, F01, F02, F11, F12, F22, D00, D01, D02, D10, D11, D12, D20, D21, D22, M00, M01, M02, M11, M12, M22,
    FRICTION_RATIO, OFFSET_VARIANCE,
    CX, CY, CZ, NX, NY, NZ, FX, FY, FZ, XI, LOG_FORCE,
    KXX, KXY, KXZ, KYY, KYZ, KZZ,
    S0, S1, S2, S3, S4, S5, DECREASE, DET, VARIANCE_RATIO, V11, V12, V22, T1X, T1Y, T1Z, T2X, T2Y, T2Z,
    U0, U1, U2, U3, U4, U5, GAIN,
    SCALE, QX, QY, QZ, AX, AY, AZ, BX, BY, BZ, NORMAL_FORCE, TRIAL_ENERGY, TRIAL_LOG_FORCE,
    UX, UY, UZ, LX, LY, LZ, AT, DISTANCE, GAP, ENTRY,
    LEFT, LEFT_DISTANCE, LEFT_SLOPE, RIGHT, RIGHT_DISTANCE, RIGHT_SLOPE,
    ENERGY, OTHER_ENERGY, LEAST_ENERGY, SEARCH, STEPS, TRIALS, REALIZED,
) = range(0, 127 * LANES, LANES)  # fmt: skip
"""Offsets of the quantities of a lane; body frame of its primitive.

`P0` to `P6`: see `contactsense.robots.surface.simd_revolved.profile`; `RADIUS`: of the ball about its
centre that holds the primitive [m]. `R00` to `OZ`: its body frame in the base frame. `W0` to `W5`, `F00` to
`M22`: fused wrench and blocks of its information matrix. `FRICTION_RATIO`, `OFFSET_VARIANCE` [m^2]: of the
prior of a contact.

`CX` to `XI`: the contact; `LOG_FORCE`: log of its normal force relative to the prior's. `KXX` to `KZZ`: shape
operator there [1/m]. `ENERGY`: see `contactsense.solvers.posterior.equations`.

`S0` to `S5`: minus the Gauss-Newton step in force, torsion and place along the tangents `T1X` to `T2Z`;
`DECREASE`: by how much it is predicted to lower the energy. `DET`: determinant of the Gauss-Newton matrix,
0 if it is not positive definite; `V11` to `V22`: covariance of the place along the tangents [m^2]. `U0` to
`U5`, `GAIN`, `VARIANCE_RATIO`: results of `inflate`.

`SCALE`: factor of the step that is tried. `QX` to `QZ`: a place beside the surface; `DISTANCE`, `AX` to
`BZ`: its distance from the surface, the nearest surface point and the normal there. `NORMAL_FORCE`,
`TRIAL_ENERGY`, `TRIAL_LOG_FORCE`: of the contact that is tried.

Of the line of action, see `contactsense.solvers.posterior.line_of_action`: `UX` to `UZ`, direction of the
force; `LX` to `LZ`, the point of the line nearest to the primitive's centre; `AT`, distance along the line
from there [m]; `LEFT` to `RIGHT_SLOPE`, such places before and beyond the nearest approach, with distance
from the surface and slope of it; `GAP`, distance between line and surface; `ENTRY`, the state of the search.

The state of a search, see `contactsense.solvers.posterior.mode`: `OTHER_ENERGY`, what adds to the
energy when lanes are compared; `LEAST_ENERGY`, below which it cannot go, the other included; `SEARCH`,
whether it goes on; `STEPS` and `TRIALS`, the number of steps and of factors tried in the present one;
`REALIZED`, the share of the predicted decrease that the last step has realized.
"""
LENGTH = 127 * LANES
"""Length of a block."""
