"""Memory layout of a block of first contacts, and of its pairs with a block of second ones, for
`contactsense.multi_contact.likelihood.pair_likelihood`; see
`contactsense.localization.surface.simd_layout`."""

from contactsense.robots.jit.lanes import LANES

(
    CX, CY, CZ, MX, MY, MZ,
    P10, P20, P21, P0, P1, P2, F0, F1, F2, FIRST_GAIN, FIRST_DET,
    F00, F10, F11, F20, F21, F22, D00, D01, D02, D10, D11, D12, D20, D21, D22, M00, M10, M11, M20, M21, M22,
    H0, H1, H2, H3, H4, H5, Q0, Q1, Q2, Q3, Q4, Q5, PUSH, SECOND_GAIN, SECOND_DET,
) = range(0, 53 * LANES, LANES)  # fmt: skip
"""Offsets of the quantities of a first contact.

`CX` to `MZ`: point [m] and outward normal. `P10` to `P2`: factors of the information matrix of its force;
`F0` to `F2`: its most likely force alone [N]; `FIRST_GAIN`, `FIRST_DET`: as for a contact near a sample.
Of the second contact, given the first, its moment eliminated: `F00` to `M22`, `H0` to `H5`: information
matrix and vector. The first force pushes with `PUSH` - (`Q0` to `Q5`) . (wrench of the second), [N].
`SECOND_GAIN`, `SECOND_DET`: what the eliminated moment adds.
"""
FIRST_LENGTH = 53 * LANES
"""Length of a block of first contacts."""
PAIRS = LANES * LANES
"""Number of pairs of two blocks; those of the first contact j begin at j * LANES."""
PAIR_GAIN, PAIR_DET, PAIR_FORCE = range(0, 3 * PAIRS, PAIRS)
"""Offsets of the quantities of the pairs of two blocks.

`PAIR_GAIN`, `PAIR_DET`: as for a contact near a sample; the gain is -infinity where there is no such pair.
`PAIR_FORCE`: the smaller one of the two forces along their normals [N].
"""
PAIR_LENGTH = 3 * PAIRS
"""Length of the pairs of two blocks."""
