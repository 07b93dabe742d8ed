"""Joint torques and base wrench obey laws that need no model of ours; Pinocchio and the given files agree."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contactsense import robots
from contactsense.benchmarks.truth import arrays, sensors, simulation, trajectory
from contactsense.benchmarks.truth.arm import Arm, read
from contactsense.benchmarks.truth.postures import Postures
from contactsense.benchmarks.truth.sensors import Contacts
from tests.oracles.pinocchio_arm import PinocchioArm
from tests.shared import truth

G = 9.81


@pytest.fixture(scope="module")
def arm() -> Arm:
    return read("ur5e")


@pytest.fixture(scope="module")
def model(arm: Arm) -> mujoco.MjModel:
    return simulation.dynamics(arm)


def contacts(rng: np.random.Generator, samples: int) -> Contacts:
    """Two contacts at random places near the arm."""
    return Contacts(
        rng.integers(0, 7, (samples, 2)),
        *(scale * rng.normal(size=(samples, 2, 3)) for scale in (0.3, 30.0, 0.3)),
    )


def no_contacts(samples: int) -> Contacts:
    return Contacts(np.full((samples, 1), -1), *(np.zeros((samples, 1, 3)) for _ in range(3)))


def centre_of_mass(arm: Arm, model: mujoco.MjModel, q: np.ndarray) -> np.ndarray:
    """Of the whole arm, shape (N, 3) [m]."""
    origin, rotation = simulation.poses(model, q)
    com = np.array([link.com for link in arm.links])
    mass = np.array([link.mass for link in arm.links])
    return np.einsum("l,nli->ni", mass, origin + np.einsum("nlij,lj->nli", rotation, com)) / mass.sum()


def test_an_arm_at_rest_weighs_what_it_weighs(arm: Arm, model: mujoco.MjModel) -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(*arm.limits, (20, 6))
    readings = sensors.read(model, q, np.zeros_like(q), np.zeros_like(q), no_contacts(20))
    weight = np.array([0.0, 0.0, -arm.mass * G])
    moment = np.cross(centre_of_mass(arm, model, q), weight)
    np.testing.assert_allclose(readings.base_wrench[:, :3], np.tile(weight, (20, 1)), atol=1e-10)
    np.testing.assert_allclose(readings.base_wrench[:, 3:], moment, atol=1e-10)


def test_contacts_add_their_wrenches_to_the_base(arm: Arm, model: mujoco.MjModel) -> None:
    """On the base as on any link, at rest as in motion."""
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.uniform(*arm.limits, (20, 6)), rng.normal(size=(20, 6)), rng.normal(size=(20, 6))
    touched = contacts(rng, 20)
    difference = (
        sensors.read(model, q, qd, qdd, touched).base_wrench
        - sensors.read(model, q, qd, qdd, no_contacts(20)).base_wrench
    )
    moment = np.cross(touched.point, touched.force) + touched.moment
    np.testing.assert_allclose(difference[:, :3], touched.force.sum(axis=1), atol=1e-10)
    np.testing.assert_allclose(difference[:, 3:], moment.sum(axis=1), atol=1e-10)


def test_torques_do_the_work_that_weight_and_contacts_do_not(arm: Arm, model: mujoco.MjModel) -> None:
    """Virtual work at rest: tau . dq = change of the potential energy minus the work of the contacts."""
    rng = np.random.default_rng(2)
    h = 1e-6
    q, step = rng.uniform(*arm.limits, (20, 6)), h * rng.normal(size=(20, 6))
    touched = contacts(rng, 20)
    torque = sensors.read(model, q, np.zeros_like(q), np.zeros_like(q), touched).torque
    lifted = np.diff([centre_of_mass(arm, model, q + s * step)[:, 2] for s in (-0.5, 0.5)], axis=0)[0]
    work = np.zeros(20)
    rows = np.arange(20)
    (o0, r0), (o1, r1), (o2, r2) = (simulation.poses(model, q + s * step) for s in (0.0, -0.5, 0.5))
    for k in range(2):
        link = touched.link[:, k]
        inside = np.einsum("nji,nj->ni", r0[rows, link], touched.point[:, k] - o0[rows, link])
        before = o1[rows, link] + np.einsum("nij,nj->ni", r1[rows, link], inside)
        after = o2[rows, link] + np.einsum("nij,nj->ni", r2[rows, link], inside)
        turned = r2[rows, link] @ np.swapaxes(r1[rows, link], 1, 2)
        work += np.einsum("ni,ni->n", touched.force[:, k], after - before)
        work += np.einsum("ni,ni->n", touched.moment[:, k], Rotation.from_matrix(turned).as_rotvec())
    done = np.einsum("ni,ni->n", torque, step)
    np.testing.assert_allclose(done / h, (arm.mass * G * lifted - work) / h, atol=1e-6)


def test_joints_beyond_the_touched_link_feel_nothing(arm: Arm, model: mujoco.MjModel) -> None:
    rng = np.random.default_rng(3)
    q = rng.uniform(*arm.limits, (20, 6))
    rest = np.zeros_like(q)
    touched = contacts(rng, 20)
    difference = (
        sensors.read(model, q, rest, rest, touched).torque
        - sensors.read(model, q, rest, rest, no_contacts(20)).torque
    )
    for i in range(20):
        np.testing.assert_allclose(difference[i, touched.link[i].max() :], 0.0, atol=1e-10)


def test_power_becomes_energy_in_motion(arm: Arm, model: mujoco.MjModel) -> None:
    """tau . qd plus the power of a contact is the rate of kinetic and potential energy, by finite
    differences; forward dynamics with these torques gives back the accelerations."""
    rng = np.random.default_rng(4)
    q, qd, qdd = trajectory.draw(arm, Postures(arm), 2, 1500, rng)
    one = contacts(rng, 1)
    touched = Contacts(*(np.repeat(column, len(q), axis=0) for column in one))
    torque = sensors.read(model, q, qd, qdd, touched).torque
    data = mujoco.MjData(model)
    energy, power = np.empty(len(q)), np.einsum("nj,nj->n", torque, qd)
    jacobian, turning = np.empty((3, 6)), np.empty((3, 6))
    for i in range(len(q)):
        data.qpos[:], data.qvel[:] = q[i], qd[i]
        data.qfrc_applied[:] = torque[i]
        mujoco.mj_fwdPosition(model, data)
        for k in range(2):
            body = int(one.link[0, k]) + 1
            point, force, moment = (column[0, k] for column in one[1:])
            mujoco.mj_jac(model, data, jacobian, turning, point, body)
            power[i] += force @ jacobian @ qd[i] + moment @ turning @ qd[i]
            mujoco.mj_applyFT(model, data, force, moment, point, body, data.qfrc_applied)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        energy[i] = data.energy.sum()
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qacc, qdd[i], atol=1e-7)
    rate = np.gradient(energy, 1.0 / arrays.RATE)
    np.testing.assert_allclose(rate[1:-1], power[1:-1], atol=2e-3 * np.abs(power).max())


def test_the_base_takes_up_the_momentum(arm: Arm, model: mujoco.MjModel) -> None:
    """Force on the sensor = weight - mass times the acceleration of the centre of mass, by differences."""
    rng = np.random.default_rng(5)
    q, qd, qdd = trajectory.draw(arm, Postures(arm), 2, 1500, rng)
    readings = sensors.read(model, q, qd, qdd, no_contacts(len(q)))
    com = centre_of_mass(arm, model, q)
    acceleration = (com[2:] - 2.0 * com[1:-1] + com[:-2]) * arrays.RATE**2
    expected = arm.mass * (np.array([0.0, 0.0, -G]) - acceleration)
    assert np.abs(acceleration).max() > 0.5
    np.testing.assert_allclose(readings.base_wrench[1:-1, :3], expected, atol=0.02)


def test_pinocchio_agrees(arm: Arm, model: mujoco.MjModel) -> None:
    oracle = PinocchioArm(robots.load("ur5e"))
    rng = np.random.default_rng(6)
    q, qd, qdd = rng.uniform(*arm.limits, (20, 6)), rng.normal(size=(20, 6)), rng.normal(size=(20, 6))
    touched = contacts(rng, 20)
    readings = sensors.read(model, q, qd, qdd, touched)
    origin, rotation = simulation.poses(model, q)
    for i in range(20):
        wrenches = []
        for k in range(2):
            link = int(touched.link[i, k])
            turned, force = rotation[i, link].T, touched.force[i, k]
            moment = touched.moment[i, k] + np.cross(touched.point[i, k] - origin[i, link], force)
            wrenches.append((link, turned @ force, turned @ moment))
        torque, wrench = oracle.inverse_dynamics(q[i], qd[i], qdd[i], wrenches)
        np.testing.assert_allclose(readings.torque[i], torque, atol=1e-7)
        np.testing.assert_allclose(readings.base_wrench[i], wrench, atol=1e-7)


@pytest.mark.parametrize("suite", ["static_points", "motion"])
def test_the_given_files_agree(model: mujoco.MjModel, suite: str) -> None:
    """Their joints, places and forces lead to their torques and wrenches."""
    data = truth(f"{suite}_ur5e.npz")
    rows = np.arange(0, len(data["q"]), 4 if suite == "static_points" else 70)
    q, link, point, force, normal, torsion, inside = (
        data[name][rows].astype(float) for name in ("q", "link", "c_base", "f", "n_base", "xi", "c_link")
    )
    rest = np.zeros_like(q)
    qd, qdd = (data[name][rows].astype(float) if name in data else rest for name in ("qd", "qdd"))
    if suite == "static_points":
        link, point, force, normal, torsion, inside = (
            column[:, None] for column in (link, point, force, normal, torsion, inside)
        )
    touched = Contacts(link.astype(int), point, force, torsion[..., None] * normal)
    readings = sensors.read(model, q, qd, qdd, touched)
    np.testing.assert_allclose(readings.torque, data["tau"][rows], atol=1e-6)
    np.testing.assert_allclose(readings.base_wrench, data["base_wrench"][rows], atol=1e-6)
    origin, rotation = simulation.poses(model, q)
    sample, slot = np.nonzero(touched.link >= 0)
    of = touched.link[sample, slot]
    found = origin[sample, of] + np.einsum("nij,nj->ni", rotation[sample, of], inside[sample, slot])
    np.testing.assert_allclose(found, point[sample, slot], atol=1e-9)
