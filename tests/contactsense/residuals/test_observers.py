"""Concatenated residuals are divided into the parts that were concatenated."""

import numpy as np

from contactsense.residuals.observers import (
    Observers,
    concatenate_residuals,
    current_parts,
    parts_of,
)
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.kernel import kernel

JOINTS, LINK_SENSORS = 6, 2


@kernel
def _differ(residuals: np.ndarray, observers: Observers) -> int:
    """Number of values that are not the observers' own."""
    found, own, count = parts_of(residuals, JOINTS, LINK_SENSORS), current_parts(observers), 0
    for k in range(own.base.shape[0]):
        count += found.base[k] != own.base[k]
    for j in range(JOINTS):
        count += found.torque_difference[j] != own.torque_difference[j]
        count += found.torque[j] != own.torque[j]
    for s in range(LINK_SENSORS):
        for i in range(6):
            count += found.link_difference[s, i] != own.link_difference[s, i]
            count += found.link_wrench[s, i] != own.link_wrench[s, i]
    return count


def test_the_parts_of_concatenated_residuals_are_the_observers_own() -> None:
    observers = zeros(Observers, joints=JOINTS, link_sensors=LINK_SENSORS)
    chance, size = np.random.default_rng(0), 0
    for group in observers:
        group.residual[:] = chance.standard_normal(group.residual.shape)
        size += group.residual.size
    residuals = np.zeros(size)
    concatenate_residuals(residuals, observers)
    assert _differ(residuals, observers) == 0
    residuals[:] += 1.0
    assert _differ(residuals, observers) == size
