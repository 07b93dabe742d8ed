"""Where the numbers of a block of cells lie.

The search over all places weighs several cells at a time, one in each lane of the processor's vector
registers. Their numbers lie in one flat array, in which each quantity has `LANES` numbers in a row; quantity
q of cell j is at q + j. Loops over j that hold only arithmetic on such numbers become vector instructions, as
the distances between them are known when the loops are compiled; branches, and calls that are not compiled
into the loop, would hinder that.
"""

LANES = 8
"""Cells in a block: as many as the widest registers take."""

(
    X, Y, Z, NX, NY, NZ, SPREAD,
    OUT,
    T1X, T1Y, T1Z, T2X, T2Y, T2Z,
    W0, W1, W2, W3, W4, W5,
    A00, A01, A02, A03, A04, A05, A11, A12, A13, A14, A15, A22, A23, A24, A25, A33, A34, A35, A44, A45, A55,
    SIZE, FORCE, ALPHA, BETA, CHI, V1, V2,
    ENERGY, LEAN, DET, VARIANCE, GOING,
) = range(0, 53 * LANES, LANES)  # fmt: skip
"""Place [m], outward unit normal and standard deviation [m] of a cell, link frame; 1 where the first look has
ruled it out, else 0; its tangents; wrench and information matrix (upper triangle) in the axes of normal and
tangents; the unknowns of `contactsense.survey`, and the force [N]; results of the search: energy without the
lean's part, squared lean in units of its variance, determinant of the curvature (0 where that is not
positive), variance of the place [m^2], and 1 while steps are worth while, else 0."""
LENGTH = 53 * LANES
"""Numbers in a block."""
