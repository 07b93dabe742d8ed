"""Columns of the numbers that the kernel for blocks of a recording returns for each sample.

First those that do not depend on the arm, then groups of n numbers, one for each joint.
"""

ENERGY, CONSISTENCY, BASE_WRENCH, BASE_WRENCH_STD, JOINTS = 0, 1, 4, 10, 16
"""First columns: energy of the no-contact hypothesis; three levels of consistency; external base wrench [N,
Nm]; its standard deviation; then the groups."""
TORQUE, TORQUE_STD, BIAS, FRICTION = range(4)
"""Groups: external joint torques; their standard deviation; biases; friction above the scene's; all in Nm."""
GROUPS = 4


def block_width(joints: int) -> int:
    """Number of columns for an arm with that many joints."""
    return JOINTS + GROUPS * joints


def group_columns(group: int, joints: int) -> slice:
    """Columns of a group."""
    first = JOINTS + group * joints
    return slice(first, first + joints)
