"""What the sensors give to the link hypotheses: rows of screw, value, variance and first link."""

from contactsense.kinematics.spatial import dot6
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants


@inlined_kernel
def fill_rows(constants: Constants, state: State, has_torque: bool, link_sensors: int) -> int:
    """Fill `State.rows` from the residuals, after `update_covariances`; returns their number.

    A joint torque measures contacts on the links beyond the joint. Of a link sensor the rows are combinations
    of force and moment whose errors are uncorrelated.

    Args:
        constants, state: With poses and residuals.
        has_torque: Whether the torques have a value.
        link_sensors: Which link sensors have one, one bit each.
    """
    rows, count = state.rows, 0
    if has_torque:
        for j in range(state.torque.shape[0]):
            for k in range(6):
                rows.screw[j, k] = state.motion.screw[j, k]
            rows.value[j] = state.torque[j]
            rows.proximal_value[j] = state.proximal_torque[j]
            rows.variance[j] = state.torque_variance[j]
            rows.first_link[j] = j + 1
        count = state.torque.shape[0]
    for s in range(state.link_wrench.shape[0]):
        if not link_sensors >> s & 1:
            continue
        for i in range(6):
            row = state.link_row[s, i]
            for k in range(6):
                rows.screw[count, k] = row[k]
            rows.value[count] = dot6(row, state.link_wrench[s])
            rows.proximal_value[count] = dot6(row, state.proximal_link_wrench[s])
            rows.variance[count] = state.link_variance[s, i]
            rows.first_link[count] = constants.sensors.first_link[s]
            count += 1
    return count
