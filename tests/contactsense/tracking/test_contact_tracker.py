"""A contact over time on constructed truth: it sharpens while it holds, it is followed where it slides."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from contactsense import Estimate, JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.residuals.observers import Observers, first_torque
from contactsense.residuals.residual_ewma import ResidualEwma
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.scene_model.constants import build_constants
from contactsense.tracking.contact_track import WINDOWS, ContactTrack
from contactsense.tracking.contact_tracker import _moment_covariances, _window_positions, choose_window
from contactsense.tracking.window_averages import average_windows, restart_windows
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
LINK = 3
START = 0.3
"""When the contact begins [s]."""
RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(
        Scene(
            robot=ARM,
            base_wrench=WrenchSensor(force_noise=0.25, moment_noise=0.05),
            joint_torque=JointTorqueSensor(noise=1.0),
            surface_error=1e-4,
        )
    )


def _held(t: float) -> float:
    """A place that does not move, see `_samples`."""
    return -0.2


@cache
def _noiseless(
    seconds: float, place: Callable[[float], float], speed: float, push: float
) -> tuple[list[Sample], np.ndarray]:
    """`_samples` without noise."""
    scene = Scene(robot=ARM)
    model, motion = build_model(ARM), empty_motion(6)
    torque, wrench = np.empty(6), np.empty(6)
    samples, points = [], []
    for t in np.arange(0.0, seconds, 0.002):
        rate = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
        q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]) + speed / rate * np.sin(rate * t)
        qd, qdd = speed * np.cos(rate * t), -speed * rate * np.sin(rate * t)
        inverse_dynamics(model, q, qd, qdd, scene.gravity_base, motion, torque, wrench)
        R, o = motion.rotation[LINK], motion.origin[LINK]
        point = R @ np.array([place(t - START), 0.04, 0.007]) + o
        if t >= START:
            force = R @ np.array([0.05, -1.0, 0.0]) * push * min((t - START) / 0.02, 1.0)
            w = np.concatenate((force, np.cross(point, force)))
            torque[:LINK] -= motion.screw[:LINK] @ w
            wrench += w
        samples.append(Sample(float(t), q, qd, torque.copy(), wrench.copy()))
        points.append(point)
    return samples, np.array(points)


def _samples(
    seconds: float, place: Callable[[float], float], seed: int, speed: float = 0.0, push: float = 20.0
) -> tuple[list[Sample], np.ndarray]:
    """A push on the forearm's tube at x = place(time since its start), link frame; all samples, and the
    contact point of each in the base frame. The arm moves with up to `speed` in each joint."""
    exact, points = _noiseless(seconds, place, speed, push)
    noise = np.random.default_rng(seed).standard_normal((len(exact), 12))
    noise[:, 6:] *= np.repeat([0.25, 0.05], 3)
    return [
        Sample(s.t, s.q, s.qd, np.add(s.joint_torque, n[:6]), np.add(s.base_wrench, n[6:]))  # type: ignore[arg-type]
        for s, n in zip(exact, noise, strict=True)
    ], points


def _errors(estimates: list[Estimate], points: np.ndarray) -> np.ndarray:
    return np.array(
        [
            np.linalg.norm(e.contacts[0].point_base - p) if e.contacts else np.inf
            for e, p in zip(estimates, points, strict=True)
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_held_contact_sharpens_with_the_root_of_time(localizer: Localizer, speed: float) -> None:
    """From 0.2 to 3.2 s of holding the noise in the stated error falls by 4. At first it also allows for a
    slide that is too slow to be seen. It is true; the arm may move."""
    early, late, stated_early, stated_late = [], [], [], []
    for seed in range(8):
        samples, points = _samples(START + 3.3, _held, seed, speed)
        estimates = list(localizer.run(samples))
        errors = _errors(estimates, points)
        first, last = round((START + 0.2) / 0.002), round((START + 3.2) / 0.002)
        early.append(errors[first])
        late.append(errors[last])
        stated_early.append(np.trace(estimates[first].contacts[0].covariance))
        stated_late.append(np.trace(estimates[last].contacts[0].covariance))
        assert [event.kind for e in estimates for event in e.events] == ["onset", "hold"]
    assert 0.6 * 4.0 < np.sqrt(np.mean(stated_early) / np.mean(stated_late)) < 2.0 * 4.0
    # Eight places with two errors each: chi-square with 16 degrees of freedom over 16, 99.9 % within.
    for errors, stated in ((early, stated_early), (late, stated_late)):
        assert 0.2 < np.sum(np.square(errors)) / np.sum(stated) < 2.5


def test_a_slide_is_followed_then_held(localizer: Localizer) -> None:
    """At rest for 0.6 s, 50 mm at 50 mm/s, at rest again."""

    def place(t: float) -> float:
        return -0.2 + 0.05 * float(np.clip(t - 0.6, 0.0, 1.0))

    samples, points = _samples(START + 3.0, place, 3)
    estimates = list(localizer.run(samples))
    errors = _errors(estimates, points)
    t = np.array([s.t for s in samples]) - START
    sliding = (t > 0.9) & (t < 1.6)  # it is noticed after 0.1 to 0.3 s
    assert np.median(errors[sliding]) < 0.006
    assert errors[sliding].max() < 0.02
    assert np.median(errors[t > 2.5]) < 0.002
    kinds = [event.kind for e in estimates for event in e.events]
    assert kinds[:3] == ["onset", "hold", "slide"]
    assert kinds[-1] == "hold"
    assert {e.contacts[0].phase for e, now in zip(estimates, sliding, strict=True) if now} == {"slide"}
    assert {c.id for e in estimates for c in e.contacts} == {1}


def test_the_end_of_a_push_is_no_slide(localizer: Localizer) -> None:
    """While the force falls to nothing within 0.1 s, what is left of it is hardly more than the observers'
    lag."""
    pushed, _ = _noiseless(START + 0.6, _held, 1.0, 30.0)
    free, _ = _noiseless(START + 0.6, _held, 1.0, 0.0)
    for seed in range(30):
        noise = np.random.default_rng(seed).standard_normal((len(pushed), 12))
        noise[:, 6:] *= np.repeat([0.25, 0.05], 3)
        samples = []
        for s, without, n in zip(pushed, free, noise, strict=True):
            share = np.clip((START + 0.5 - s.t) / 0.1, 0.0, 1.0)
            torque, wrench = (
                share * np.asarray(a) + (1.0 - share) * np.asarray(b) + own
                for a, b, own in (
                    (s.joint_torque, without.joint_torque, n[:6]),
                    (s.base_wrench, without.base_wrench, n[6:]),
                )
            )
            samples.append(Sample(s.t, s.q, s.qd, torque, wrench))
        kinds = [event.kind for estimate in localizer.run(samples) for event in estimate.events]
        assert kinds == ["onset", "hold", "release"]


def test_force_and_wrench_are_the_newest(localizer: Localizer) -> None:
    samples, _ = _samples(START + 1.0, _held, 4)
    model, motion = build_model(ARM), empty_motion(6)
    kinematics_and_momenta(model, samples[0].q, samples[0].qd, np.zeros(3), motion)
    more = motion.rotation[LINK] @ np.array([0.0, -30.0, 0.0])
    point = motion.rotation[LINK] @ np.array([-0.2, 0.04, 0.007]) + motion.origin[LINK]
    w = np.concatenate((more, np.cross(point, more)))
    late = len(samples) - 60  # 0.12 s, seven time constants
    for i in range(late, len(samples)):
        s = samples[i]
        assert s.joint_torque is not None
        assert s.base_wrench is not None
        pushed = np.where(np.arange(6) < LINK, motion.screw @ w, 0.0)
        samples[i] = Sample(s.t, s.q, s.qd, s.joint_torque - pushed, s.base_wrench + w)
    last = list(localizer.run(samples))[-1]
    assert np.linalg.norm(last.contacts[0].force_base) == pytest.approx(50.0, abs=1.5)
    assert np.linalg.norm(last.wrench[:3]) == pytest.approx(50.0, abs=1.5)
    np.testing.assert_allclose(last.contacts[0].point_base, point, atol=0.004)


def test_without_a_base_sensor_a_changed_force_is_not_averaged_with_the_one_before() -> None:
    """The torques of the two differ, though the place does not."""
    torques = Localizer(Scene(robot=ARM, base_wrench=None, joint_torque=JointTorqueSensor(noise=1.0)))
    light, heavy = (_samples(START + 2.4, _held, seed, 0.0, push)[0] for seed, push in ((4, 30.0), (5, 60.0)))
    change = START + 1.2
    felt = [one if one.t < change else other for one, other in zip(light, heavy, strict=True)]
    samples = [replace(sample, base_wrench=None) for sample in felt]
    force = {
        round(sample.t - change, 3): np.linalg.norm(estimate.contacts[0].force_base)
        for sample, estimate in zip(samples, torques.run(samples), strict=True)
        if estimate.contacts
    }
    # Torques alone do not tell where on the link and how strong: the force is that which they determine.
    assert force[0.2] / force[-0.1] == pytest.approx(2.0, rel=0.05)
    assert force[1.1] / force[-0.1] == pytest.approx(2.0, rel=0.05)


def test_contacts_end_and_are_numbered(localizer: Localizer) -> None:
    samples, _ = _samples(START + 0.4, _held, 5)
    free, _ = _samples(START, _held, 6)
    gap = samples[-1].t + 0.002
    free = [Sample(gap + s.t, s.q, s.qd, s.joint_torque, s.base_wrench) for s in free]
    again = [Sample(gap + START + s.t, s.q, s.qd, s.joint_torque, s.base_wrench) for s in samples]
    estimates = list(localizer.run([*samples, *free, *again]))
    events = [(event.kind, event.contact) for e in estimates for event in e.events]
    assert [e for e in events if e[0] in ("onset", "release")] == [("onset", 1), ("release", 1), ("onset", 2)]
    assert estimates[-1].contacts[0].id == 2
    released = next(e for e in estimates if any(event.kind == "release" for event in e.events))
    assert released.status == "none"


@pytest.mark.parametrize("force", [10.0, 25.0])
def test_an_impact_of_20_ms_is_not_missed(localizer: Localizer, force: float) -> None:
    """A half sine of 20 ms: found each time, within the impact or the observer's time constant after it."""
    for seed in range(5):
        samples, points = _samples(START + 0.3, _held, seed, push=0.0)
        model, motion = build_model(ARM), empty_motion(6)
        kinematics_and_momenta(model, samples[0].q, samples[0].qd, np.zeros(3), motion)
        unit = np.concatenate((motion.rotation[LINK] @ [0.0, -1.0, 0.0], np.zeros(3)))
        unit[3:] = np.cross(points[0], unit[:3])
        for i, s in enumerate(samples):
            w = unit * force * np.sin(np.pi * np.clip((s.t - START) / 0.02, 0.0, 1.0))
            pushed = np.where(np.arange(6) < LINK, motion.screw @ w, 0.0)
            assert s.joint_torque is not None
            assert s.base_wrench is not None
            samples[i] = Sample(s.t, s.q, s.qd, s.joint_torque - pushed, s.base_wrench + w)
        onsets = [event.t for e in localizer.run(samples) for event in e.events if event.kind == "onset"]
        assert len(onsets) == 1
        assert START < onsets[0] < START + 0.036


def test_jitter_and_lost_samples_change_nothing_but_the_noise(localizer: Localizer) -> None:
    """1 % of the samples lost, stamps that jitter by 0.5 ms: the places of a held contact on a moving arm are
    those of a steady stream, to the noise."""
    plain, ragged = [], []
    for seed in range(6):
        chance = np.random.default_rng(seed)
        samples, points = _samples(START + 1.0, _held, seed, 0.5)
        plain.append(_errors(list(localizer.run(samples)), points)[-250:])
        keep = chance.random(len(samples)) >= 0.01
        kept = [
            Sample(s.t + chance.uniform(-5e-4, 5e-4), s.q, s.qd, s.joint_torque, s.base_wrench)
            for s, stays in zip(samples, keep, strict=True)
            if stays
        ]
        ragged.append(_errors(list(localizer.run(kept)), points[keep])[-240:])
    assert np.isfinite(np.concatenate(ragged)).all()
    assert np.median(np.concatenate(ragged)) < 1.5 * np.median(np.concatenate(plain))


@pytest.mark.slow
def test_stated_covariance_of_a_position_on_the_tangent_plane() -> None:
    """That of the line of action's intersection with it, for one sample's noise and 20 N along the normal.
    The sensor is far away, so that noise of force and of moment count."""
    base = WrenchSensor(
        force_noise=0.25, moment_noise=0.05, translation=(0.1, -0.2, -0.3), rpy=(0.3, -0.4, 0.5)
    )
    constants = build_constants(Scene(robot=ARM, base_wrench=base, joint_torque=None))
    motion, track = empty_motion(6), zeros(ContactTrack, joints=6, link_sensors=0, links=6)
    forward_kinematics(constants.model, np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]), motion)
    track.status[0].last_body = LINK
    track.last_point[:], track.last_normal[:] = (-0.2, 0.04, 0.007), (0.36, 0.48, 0.8)
    track.windows["variance_ratio"] = 1.0
    R, o = motion.rotation[LINK], motion.origin[LINK]
    force = R @ track.last_normal * -20.0
    wrench = np.concatenate((force, np.cross(R @ track.last_point + o, force)))
    noise = np.random.default_rng(0).multivariate_normal(
        np.zeros(6), constants.sensors.base_covariance, 4000 * WINDOWS
    )
    positions = []
    for drawn in (wrench + noise).reshape(4000, WINDOWS, 6):
        f, m = drawn[:, :3], drawn[:, 3:] - np.cross(o, drawn[:, :3])
        track.mean[:, 6 * LINK : 6 * LINK + 6] = np.hstack((f @ R, m @ R))
        _window_positions(track)
        positions += [np.array([track.windows[i].x, track.windows[i].y]) for i in range(WINDOWS)]
    _moment_covariances((constants.sensors.base_covariance, np.zeros((6, 6))), motion, track, 10.0)
    window = track.windows[2]
    xx, xy, yy = np.array([window.moment_xx, window.moment_xy, window.moment_yy]) / 20.0**2
    np.testing.assert_allclose(np.mean(positions, axis=0), 0.0, atol=1e-3)
    found = np.cov(np.array(positions).T)
    np.testing.assert_allclose(found, [[xx, xy], [xy, yy]], atol=0.03 * np.trace(found))
    assert abs(xy) > 0.2 * np.sqrt(xx * yy)


@pytest.mark.slow
@pytest.mark.parametrize("sustained", [False, True])
def test_a_sustained_contact_begins_with_the_average_that_showed_it(sustained: bool) -> None:
    sizes = {"joints": 6, "link_sensors": 0, "links": 7}
    track, ewma, observers = (zeros(kind, **sizes) for kind in (ContactTrack, ResidualEwma, Observers))
    observers.joints.residual[:], ewma.mean[:] = 1.0, 2.0
    status = ewma.status[0]
    status.samples, status.age, status.variance_ratio, status.residual_covariance = 40.0, 0.1, 0.01, 0.02
    track.status[0].sustained, track.status[0].last_body = sustained, -1
    average_windows(track, ewma, observers, 0.06, 2, 0.002, 10.0)
    motion, scene = empty_motion(6), Scene(robot=ARM, base_wrench=None)
    sensors = build_constants(scene).sensors
    base_noise, torque_noise = (sensors.base_covariance, np.zeros((6, 6))), (sensors.torque_variance, 1.0)
    usable = (False, True, 0)
    assert not choose_window(torque_noise, base_noise, track, motion, usable, 0.002, 10.0)
    np.testing.assert_array_equal(track.mean[0, first_torque(6) : first_torque(6) + 6], 1.0)
    if sustained:
        np.testing.assert_array_equal(track.mean[1:], 2.0)
        for i in range(1, WINDOWS):
            window = track.windows[i]
            found = (window.samples, window.age, window.variance_ratio, window.residual_covariance)
            assert found == (40.0, 0.1, 0.01, 0.02)
        assert track.status[0].window == 1
    else:
        np.testing.assert_array_equal(track.mean[1:], np.tile(track.mean[0], (WINDOWS - 1, 1)))
        assert track.status[0].window == 0


def test_restarted_windows_hold_the_newest_residual_alone() -> None:
    """Its age included: with that of what they held before, a contact at rest would seem to slide."""
    track = zeros(ContactTrack, joints=6, link_sensors=0, links=6)
    for i in range(WINDOWS):
        track.mean[i] = i
        window = track.windows[i]
        window.samples, window.age, window.variance_ratio, window.residual_covariance = i + 2, i + 3, i + 4, 7
    track.link_weight[:] = 1.0
    restart_windows(track)
    np.testing.assert_array_equal(track.mean, 0.0)
    for i in range(1, WINDOWS):
        window = track.windows[i]
        found = (window.samples, window.age, window.variance_ratio, window.residual_covariance)
        assert found == (1.0, 3.0, 4.0, 7.0)
    np.testing.assert_array_equal(track.link_weight, 0.0)
