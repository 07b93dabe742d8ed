"""Memory layout of a block of samples, see `contactsense.localization.surface.simd_layout`."""

from contactsense.robots.jit.lanes import LANES

X, Y, Z, NX, NY, NZ, GAIN, DET, NORMAL_FORCE, HIGHEST = range(0, 10 * LANES, LANES)
"""Offsets of the quantities of a sample in a block of samples.

`X` to `NZ`: point [m] and outward unit normal, base frame. `GAIN`, `DET`, `NORMAL_FORCE`: see
`contactsense.multi_contact.likelihood.link_information.likelihood_near_samples`. `HIGHEST`: scratch, the
highest `GAIN` of those beside which it was computed.
"""
BLOCK_LENGTH = 10 * LANES
"""Length of a block."""
