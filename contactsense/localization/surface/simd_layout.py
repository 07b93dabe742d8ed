"""Memory layout of a block of surface cells that is processed with SIMD instructions.

The search over the surface evaluates `LANES` cells at a time, one in each lane of the processor's vector
registers. A block is one flat array in which every quantity has `LANES` consecutive numbers: quantity Q of
cell j is at index Q + j. Loops over j are vectorized by the compiler if they contain arithmetic only,
because all strides are compile-time constants. Branches and calls that are not inlined prevent
vectorization.
"""

from contactsense.robots.jit.lanes import LANES

(
    X, Y, Z, NX, NY, NZ, SPREAD, TILT,
    BOUND,
    T1X, T1Y, T1Z, T2X, T2Y, T2Z,
    W0, W1, W2, W3, W4, W5,
    A00, A01, A02, A03, A04, A05, A11, A12, A13, A14, A15, A22, A23, A24, A25, A33, A34, A35, A44, A45, A55,
    RATIO_INFORMATION, LOG_FORCE, FORCE, ALPHA, BETA, CHI, V1, V2,
    ENERGY, DET, V11, V12, V22, ACTIVE,
    LOG_EVIDENCE, PX, PY, PZ, FX, FY, FZ,
) = range(0, 63 * LANES, LANES)  # fmt: skip
"""Offsets of the quantities of a cell.

`X` to `NZ`, `SPREAD`, `TILT`: centre [m], outward unit normal, standard deviation [m] and tilt [rad] of the
cell, link frame, see `contactsense.localization.surface.surface_samples`.
`BOUND`: lower bound of its energy, infinite if `contactsense.localization.surface_search.energy_bound`
excludes it.
`T1X` to `T2Z`: unit tangents. `W0` to `W5`, `A00` to `A55`: measured wrench and its information matrix
(upper triangle), about the cell's centre, in the axes of normal and tangents.
`RATIO_INFORMATION`: inverse variance of the friction ratio.
`LOG_FORCE`, `ALPHA`, `BETA`, `CHI`, `V1`, `V2`: the unknowns, see
`contactsense.localization.surface_search.laplace_evidence`; `FORCE`: normal force [N].
`ACTIVE`, 1 while the iteration goes on, else 0; `DET`, determinant of the Gauss-Newton matrix (0 if it is not
positive definite).
Results: `ENERGY`; `LOG_EVIDENCE`, log of the mean evidence over the cell, up to the constant of the noise
(infinity and -infinity if the energy is above the limit); `V11`, `V12`, `V22`, covariance of the place along
the tangents [m^2]; `PX` to `FZ`, the most probable point [m] and force [N], link frame.
"""
LENGTH = 63 * LANES
"""Length of a block."""
