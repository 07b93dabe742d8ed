"""Without a base sensor, noise of the torques that is larger than stated is no change of the contact."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, forward_model
from contactsense.tracking.contact_track import WINDOWS
from tests.plain_arm import plain_ur5e

STEP, ONSET, SETTLED, END = 0.002, 300, 600, 1000
"""Time between samples [s], and numbers of samples: of the onset, from which on the contact is old, and of
all."""
Q = np.array([0.3, -1.2, 1.4, -1.0, -1.5, 0.4])


@pytest.mark.parametrize("times", [1.0, 2.5])
def test_a_steady_contact_is_averaged_for_as_long_as_it_lasts(times: float) -> None:
    """Noise: so many times the stated one."""
    scene = Scene(robot=plain_ur5e(), base_wrench=None, joint_torque=JointTorqueSensor(noise=0.4))
    place, push = np.array([-0.2, 0.0, 0.047]), np.array([5.0, 10.0, -30.0])
    free = forward_model(scene, Q, "forearm", place, np.zeros(3)).joint_torque
    touched = forward_model(scene, Q, "forearm", place, push).joint_torque
    localizer, chance, used = Localizer(scene), np.random.default_rng(0), []
    for i in range(END):
        torque = (free if i < ONSET else touched) + times * 0.4 * chance.standard_normal(6)
        localizer.step(Sample(i * STEP, Q, np.zeros(6), torque))
        used.append(int(localizer._buffers.state.track.status[0].window))
    assert np.mean(np.array(used[SETTLED:]) == WINDOWS - 1) > 0.95
