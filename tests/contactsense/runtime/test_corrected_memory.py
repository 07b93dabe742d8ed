"""A correction of the masses changes residuals and momenta at once. What is remembered of earlier ones
follows, so that it is taken neither for a contact nor for a sudden change of the motion."""

from dataclasses import replace

import numpy as np

from contactsense import JointTorqueSensor, Localizer, Sample, Scene
from contactsense.residuals.momentum_observer import noise_variance_ratio
from contactsense.robots import Inertia, Link, Robot
from tests.contactsense.link_sensors.truth import ARM, FOREARM, SENSOR, STEP, Oracle, motion, noisy, stream

INERTIA_ERROR = 0.05
TORQUE_NOISE = 1.0
"""Of `stream`, and a sensor's by default [Nm]."""


def _heavier() -> Robot:
    """The arm with forearm and wrists as much heavier as the scenes say that they may be."""
    links = tuple(
        replace(link, inertia=_scaled(link, 1.0 + INERTIA_ERROR)) if i >= FOREARM else link
        for i, link in enumerate(ARM.links)
    )
    return replace(ARM, links=links)


def _scaled(link: Link, factor: float) -> Inertia:
    body = link.inertia
    return Inertia(factor * body.mass, body.com, factor * body.tensor)


def test_the_average_of_a_link_sensor_is_corrected_as_its_residual_is() -> None:
    """Precise torques tell the masses in one update, and the sensor's residual falls by newtons."""
    torque = JointTorqueSensor(noise=0.1)
    scene = Scene(
        robot=ARM, base_wrench=None, joint_torque=torque, link_wrenches=(SENSOR,), inertia_error=INERTIA_ERROR
    )
    oracle, chance, samples = Oracle(_heavier(), scene.gravity_base), np.random.default_rng(0), []
    q, still = motion(0.0)[0], np.zeros(6)
    exact = oracle.at(q, still, still)
    rotation, place = oracle.pose(q, FOREARM)
    for i in range(400):
        read = noisy(exact, scene, place + rotation @ np.array(SENSOR.translation), chance)
        measured = exact.torque + 0.1 * (read.torque - exact.torque)
        samples.append(Sample(i * STEP, q, still, measured, link_wrenches={SENSOR.name: read.forearm}))
    estimates = list(Localizer(scene).run(samples))
    assert [estimate.t for estimate in estimates if estimate.contacts] == []
    assert estimates[-1].status == "none"


def test_corrected_momenta_are_no_sudden_change_of_the_motion() -> None:
    scene = Scene(robot=ARM, link_wrenches=(SENSOR,), inertia_error=INERTIA_ERROR)
    localizer = Localizer(scene)
    of_instants = localizer._buffers.state.timing_error.variance
    noise = TORQUE_NOISE**2 * noise_variance_ratio(scene.bandwidth, STEP)
    updates = 0
    for sample in stream(scene, 0.6, robot=_heavier()):
        localizer.step(sample)
        updates += localizer._buffers.state.bias_filter.status[0].time_since_update == 0.0
        assert of_instants.max() < 0.01 * noise
    assert updates > 1
