"""What is known before of some contacts, as further rows of the joint optimization: U (z - z0), with unit
variance, where z are point, force, torsion and offset of the known contacts; see
`contactsense.multi_contact.known_contacts.known_prior`."""

from typing import NamedTuple

from contactsense.kinematics.linalg.lanes import add_dots, clear
from contactsense.multi_contact.memory.buffers import KNOWN_NUMBERS, OTHERS, PLACES, UNKNOWNS, JointState
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    FX, FY, FZ, JACOBIAN, OFFSET, OFFSET_STEP, PX, PY, PZ, SX, TORSION, TORSION_STEP, TX, Z0, Z1, Z2, Z3, Z4,
    Z5, Z6, Z7,
)  # fmt: skip


class Known(NamedTuple):
    """How many contacts of a set are known, and what may have changed since they were estimated."""

    contacts: int
    """Number of known contacts, the first ones of each set."""
    drift: float
    """Standard deviation of the change of each component of their forces [N]; infinity: forces and torsions
    are new ones."""
    measured: bool
    """Whether the contacts are known from one sample of the same sensors, as at rest. Else, in a stream,
    their forces are taken for exact before they change."""


class KnownRows(NamedTuple):
    """Size of `JointState.known_rows`."""

    contacts: int
    """Number of known contacts, the first ones of each set."""
    rows: int


@fused_kernel
def unknown_of_factor(a: int, known_count: int) -> int:
    """Index in the joint optimization of an unknown of `KnownPriorScratch.factor`, where the places of all
    known contacts come first."""
    if a < PLACES * known_count:
        return a // PLACES * UNKNOWNS + 4 + a % PLACES
    b = a - PLACES * known_count
    return b // OTHERS * UNKNOWNS + b % OTHERS + PLACES * (b % OTHERS // 4)


@fused_kernel
def fill_known_residuals(known: KnownRows, joint: JointState) -> None:
    """Fill `joint.known_residual`."""
    clear(joint.known_residual, 0, known.rows)
    for i in range(known.contacts):
        block, mean = joint.contact[i], joint.known_mean[i]
        for j in range(LANES):
            block[Z0 + j] = block[PX + j] - mean[j]
            block[Z1 + j] = block[PY + j] - mean[LANES + j]
            block[Z2 + j] = block[PZ + j] - mean[2 * LANES + j]
            block[Z3 + j] = block[FX + j] - mean[3 * LANES + j]
            block[Z4 + j] = block[FY + j] - mean[4 * LANES + j]
            block[Z5 + j] = block[FZ + j] - mean[5 * LANES + j]
            block[Z6 + j] = block[TORSION + j] - mean[6 * LANES + j]
            block[Z7 + j] = block[OFFSET + j] - mean[7 * LANES + j]
        matrix, n = joint.known_rows[i], KNOWN_NUMBERS
        add_dots(joint.known_residual, (0, 1), matrix, (0, n), block, Z0 // LANES, known.rows, n, 1.0)


@fused_kernel
def add_known_information(known: KnownRows, joint: JointState) -> None:
    """Add the rows of the known contacts to their Gauss-Newton matrices and gradients, after
    the derivatives of the wrenches."""
    H, g, J, residual = joint.matrix, joint.step, joint.known_jacobian, joint.known_residual
    n, count = KNOWN_NUMBERS, known.rows
    for i in range(known.contacts):
        at, block, matrix = i * UNKNOWNS, joint.contact[i], joint.known_rows[i]
        for a in range(UNKNOWNS):
            clear(J[at + a], 0, count)
        for a in range(3):
            # The first three numbers of a derivative of the wrench are those of the force.
            column = JACOBIAN // LANES + 6 * a
            add_dots(J[at + a], (0, 1), matrix, (3, n), block, column, count, 3, 1.0)
        add_dots(J[at], (0, 1), matrix, (6, n), block, TORSION // LANES, count, 1, 1.0)
        add_dots(J[at + 3], (0, 1), matrix, (6, n), block, TORSION_STEP // LANES, count, 1, 1.0)
        add_dots(J[at + 4], (0, 1), matrix, (0, n), block, SX // LANES, count, 3, 1.0)
        add_dots(J[at + 5], (0, 1), matrix, (0, n), block, TX // LANES, count, 3, 1.0)
        add_dots(J[at + 6], (0, 1), matrix, (7, n), block, OFFSET_STEP // LANES, count, 1, 1.0)
    # The first rows are those of the places, of one contact each.
    step, first = J.shape[1] // LANES, PLACES * known.contacts
    for a in range(known.contacts * UNKNOWNS):
        add_dots(g, (a, 1), J[a], (0, 1), residual, 0, 1, count, 1.0)
        add_dots(H[a], (0, 1), J, (first, step), J[a], first, a + 1, count - first, 1.0)
    for i in range(known.contacts):
        for a in range(i * UNKNOWNS + 4, i * UNKNOWNS + 4 + PLACES):
            b = i * UNKNOWNS + 4
            add_dots(H[a], (b, 1), J, (b * step + PLACES * i, step), J[a], PLACES * i, a - b + 1, PLACES, 1.0)
