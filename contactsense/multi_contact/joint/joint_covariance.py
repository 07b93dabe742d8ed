"""Covariances of the contacts at a joint optimum: of their places, and of the sum of the wrenches.

With the matrix H = L L^T, the covariance of a^T x and b^T x is (L^-1 a) . (L^-1 b). Only a few directions are
needed of the inverse.
"""

from contactsense.kinematics.linalg.lanes import add_dots, clear, substitute
from contactsense.multi_contact.memory.buffers import COVARIANCE_ROOTS, UNKNOWNS, JointState
from contactsense.multi_contact.memory.joint_layout import JACOBIAN
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES


@fused_kernel
def fill_covariances(count: int, joint: JointState) -> None:
    """Fill `joint.covariance`, after `contactsense.multi_contact.joint.joint_optimization.find_joint_modes`.

    Directions 2 i, 2 i + 1: step of contact i along the tangents; 2 `count` to 2 `count` + 5: sum of the
    wrenches.
    """
    size = count * UNKNOWNS
    for i in range(count):
        for e in range(2):
            root = joint.root[2 * i + e]
            clear(root, 0, size)
            a = i * UNKNOWNS + 4 + e
            for j in range(LANES):
                root[a * LANES + j] = 1.0
            substitute(joint.matrix, size, joint.inverse_diagonal, root)
            for d in range(e + 1):
                _fill(size, 2 * i + e, 2 * i + d, joint)
    first = 2 * count
    for k in range(6):
        root = joint.root[first + k]
        for i in range(count):
            for a in range(UNKNOWNS):
                for j in range(LANES):
                    root[(i * UNKNOWNS + a) * LANES + j] = joint.contact[
                        i, JACOBIAN + (6 * a + k) * LANES + j
                    ]
        substitute(joint.matrix, size, joint.inverse_diagonal, root)
        for d in range(k + 1):
            _fill(size, first + k, first + d, joint)


@fused_kernel
def _fill(size: int, a: int, b: int, joint: JointState) -> None:
    at = a * COVARIANCE_ROOTS + b
    clear(joint.covariance, at, 1)
    add_dots(joint.covariance, (at, 1), joint.root[a], (0, 1), joint.root[b], 0, 1, size, 1.0)


@fused_kernel
def covariance_of(joint: JointState, a: int, b: int, lane: int) -> float:
    """Covariance of two directions of one contact or of the wrench, in a lane."""
    return float(joint.covariance[(max(a, b) * COVARIANCE_ROOTS + min(a, b)) * LANES + lane])
