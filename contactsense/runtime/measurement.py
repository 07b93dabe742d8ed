"""One measurement of an arm at rest, which a caller has given and which may be unusable."""

import math

import numpy as np

from contactsense.robots.jit.kernel import inlined_kernel, kernel
from contactsense.runtime.state import State
from contactsense.runtime.static_residuals import Measured, take_static_sample
from contactsense.scene_model.constants import Constants
from contactsense.scene_model.reading_limits import (
    TORQUE_SCALE,
    are_positions_within,
    are_torques_within,
    is_base_plausible,
    is_contact_wrench,
)
from contactsense.sensors.usable_sensors import Usable

NOT_FINITE, DOUBTFUL, UNTOUCHED = -1, -2, -3
"""Why a measurement has no candidates: its values cannot be used, may be implausible, or show no contact."""


@inlined_kernel
def take_measurement(
    constants: Constants, state: State, measured: Measured, external: bool, usable: Usable, checked: bool
) -> int:
    """`take_static_sample` for values that may be unusable.

    Args:
        constants, state, measured, external: As there.
        usable: Which sensors have measured.
        checked: Whether values that may be implausible are refused, apart from link sensors with a known
            range.

    Returns:
        0; `NOT_FINITE` where a vector has the wrong size or is not finite, `DOUBTFUL` where the measurement
        may be implausible.
    """
    q, torque, base_wrench, link_wrench = measured
    n = state.torque.shape[0]
    if not (is_finite_vector(q, n) and is_finite_vector(torque, n) and is_finite_vector(base_wrench, 6)):
        return NOT_FINITE
    for s in range(link_wrench.shape[0]):
        if not is_finite_vector(link_wrench[s], 6):
            return NOT_FINITE
    take_static_sample(constants, state, measured, external)
    if checked and not _is_plausible(constants, state, measured, external, usable):
        return DOUBTFUL
    return 0


@kernel
def is_finite_vector(vector: np.ndarray, size: int) -> bool:
    """Whether a vector has `size` numbers, all finite. NumPy takes ten times as long for six of them."""
    if len(vector) != size:
        return False
    for value in vector:  # noqa: SIM110 (a generator cannot be compiled)
        if not math.isfinite(value):
            return False
    return True


@inlined_kernel
def _is_plausible(
    constants: Constants, state: State, measured: Measured, external: bool, usable: Usable
) -> bool:
    """Whether a measurement is surely plausible, apart from link sensors with a known range; after
    `take_static_sample`, whose arguments these are, and which sensors have measured."""
    q, torque, base_wrench, link_wrench = measured
    limits, weight = constants.limits, state.motion.gravity[0]
    # What remains of a plausible torque after a plausible model's is subtracted.
    scale = TORQUE_SCALE + 1.0 if external else TORQUE_SCALE
    if not are_positions_within(limits, q) or (usable[1] and not are_torques_within(limits, torque, scale)):
        return False
    for s in range(link_wrench.shape[0]):
        if not is_contact_wrench(link_wrench[s], weight):
            return False
    return not usable[0] or is_base_plausible(limits, base_wrench, weight, external)
