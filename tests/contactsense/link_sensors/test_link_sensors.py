"""A force/torque sensor below the forearm: what it carries, what it tells apart, and where it fails."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from contactsense import JointTorqueSensor, Localizer, Sample, SampleBlock, Scene, SceneError, WrenchSensor
from contactsense.robots import Inertia, Link, Robot
from contactsense.robots.tool import Tool
from contactsense.scene_model.link_sensor_frame import LinkSensorFrame
from contactsense.scene_model.load_weight import LoadWeight
from tests.contactsense.link_sensors.truth import (
    ARM,
    BASE,
    FOREARM,
    SENSOR,
    STEP,
    TORQUE,
    Load,
    Oracle,
    motion,
    stream,
)
from tests.plain_arm import Truth, contacts

pytestmark = pytest.mark.slow  # its kernels compile for long

FIELD = "link_wrenches.forearm"
ALL = Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE, link_wrenches=(SENSOR,), bandwidth=20.0)
WITHOUT_BASE = ALL.model_copy(update={"base_wrench": None})
Q = np.array([0.2, -1.2, 1.4, -0.9, -1.3, 0.4])
ZERO = np.zeros(6)


def _with_masses(factors: np.ndarray) -> Robot:
    """The arm with other masses, and inertias in proportion to them."""
    links = tuple(
        Link(x.name, Inertia(f * x.inertia.mass, x.inertia.com, f * x.inertia.tensor), x.primitives)
        for f, x in zip(factors, ARM.links, strict=True)
    )
    return replace(ARM, links=links)


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(ALL)


@pytest.fixture(scope="module")
def truth() -> Truth:
    return contacts(ARM, 300, seed=11)


def forearm_wrench(truth: Truth) -> np.ndarray:
    """External wrench on the sensor: that of the contacts on the forearm and beyond."""
    return np.where(truth.link[:, None] >= FOREARM, truth.base_wrench, 0.0)


def noise(truth: Truth, chance: np.random.Generator) -> np.ndarray:
    """Noise of the forearm's sensor in base axes, about the base origin, shape (N, 6)."""
    oracle, rows = Oracle(), []
    for q in truth.q:
        rotation, place = oracle.pose(q, FOREARM)
        force, moment = chance.standard_normal((2, 3)) * [[SENSOR.force_noise], [SENSOR.moment_noise]]
        lever = place + rotation @ np.array(SENSOR.translation)
        rows.append(np.concatenate((force, moment + np.cross(lever, force))))
    return np.array(rows)


def push_on(link: int, point: tuple[float, float, float], force: tuple[float, float, float]) -> Load:
    return link, np.array(force), np.cross(point, force)


def test_the_frame_of_the_sensor_is_that_of_its_link() -> None:
    rotation, place = Oracle().pose(Q, FOREARM)
    turn, origin = rotation @ SENSOR.rotation, place + rotation @ np.array(SENSOR.translation)
    wrench, frame = np.array([3.0, -2.0, 7.0, 0.5, 0.4, -0.6]), LinkSensorFrame(ALL, FIELD)
    force, moment = turn.T @ wrench[:3], turn.T @ (wrench[3:] - np.cross(origin, wrench[:3]))
    np.testing.assert_allclose(frame.reading(Q, wrench), np.concatenate((force, moment)), atol=1e-9)
    np.testing.assert_allclose(frame.wrench(Q, frame.reading(Q, wrench)), wrench, atol=1e-9)


@pytest.mark.parametrize("mounting", ["table", (0.4, 2.8, 0.2)])
def test_the_load_at_rest_is_that_of_pinocchio(mounting: object) -> None:
    scene = ALL.model_copy(update={"mounting": mounting})
    exact = Oracle(ARM, scene.gravity_base).at(Q, ZERO, ZERO)
    np.testing.assert_allclose(LoadWeight(scene, FIELD).wrench(Q), exact.forearm, atol=1e-9)
    # Raw readings of a free arm leave nothing.
    found = Localizer(scene).locate(
        Q,
        base_wrench=exact.base,
        joint_torque=exact.torque,
        link_wrenches={"forearm": exact.forearm},
        external=False,
    )
    assert found.status == "none"


def test_the_load_in_motion_is_that_of_pinocchio(localizer: Localizer) -> None:
    """Without noise and contact nothing remains but the error of the integration over steps of 2 ms."""
    oracle, state = Oracle(), localizer._buffers.state
    largest, moved = 0.0, 0.0
    localizer.reset()
    for i in range(1000):
        q, qd, qdd = motion(i * STEP)
        exact = oracle.at(q, qd, qdd)
        still = oracle.at(q, ZERO, ZERO)
        moved = max(moved, float(np.abs(exact.forearm - still.forearm).max()))
        localizer.step(Sample(i * STEP, q, qd, exact.torque, exact.base, None, {"forearm": exact.forearm}))
        largest = max(largest, float(np.abs(state.observers.links.residual).max()))
        largest = max(largest, float(np.abs(state.observers.link_difference.residual).max()))
    assert moved > 5.0
    assert largest < 1e-3


@pytest.mark.parametrize("scene", [ALL, WITHOUT_BASE], ids=["all", "without base"])
@pytest.mark.parametrize("velocity_noise", [0.0, 0.001, 0.003])
def test_no_false_alarms_in_motion(scene: Scene, velocity_noise: float) -> None:
    found = list(Localizer(scene).run(stream(scene, 8.0, seed=3, velocity_noise=velocity_noise)))
    assert {estimate.status for estimate in found[100:]} == {"none"}


def test_noise_of_the_velocities_leaves_the_energy_that_of_chance() -> None:
    """In some directions it hardly disturbs a precise sensor; those directions turn with the arm."""
    base = BASE.model_copy(update={"force_noise": 0.05, "moment_noise": 0.01})
    made = Scene(robot=ARM, base_wrench=base, joint_torque=None, link_wrenches=(SENSOR,))
    localizer, energies = Localizer(made.model_copy(update={"link_wrenches": ()})), []
    for sample in stream(made, 8.0, seed=5, velocity_noise=0.003):
        localizer.step(replace(sample, link_wrenches=None))
        energies.append(localizer._buffers.state.no_contact_energy[0])
    # Three hundred independent samples, each beyond this with probability 0.001.
    assert np.mean(np.array(energies[300:]) > 0.5 * chi2.isf(1e-3, 6)) < 4e-3


def test_errors_of_the_masses_are_no_contact() -> None:
    """Every link is heavier or lighter by a few per cent, as the scene permits."""
    chance = np.random.default_rng(8)
    factors = 1.0 + 0.03 * chance.standard_normal(len(ARM.links))
    scene = ALL.model_copy(update={"inertia_error": 0.03})
    samples = stream(scene, 6.0, seed=4, robot=_with_masses(factors))
    found = list(Localizer(scene).run(samples))
    assert not any(estimate.contacts for estimate in found)
    # Taken for exact, the same masses are an external force.
    found = list(Localizer(ALL).run(samples[:500]))
    assert {estimate.status for estimate in found[100:]} == {"ambiguous"}


def test_errors_of_the_masses_show_no_more_than_themselves() -> None:
    """A link's mass is one unknown. Its error adds to all six components of a wrench, but explains them all:
    together they have no more energy than half its square in standard deviations."""
    told, heavier = 0.1, np.array([0.0, 0.0, 0.2, 0.2, 0.2, 0.2, 0.2])
    sensor = SENSOR.model_copy(update={"force_noise": 0.01, "moment_noise": 0.001})
    nothing = JointTorqueSensor(noise=1e3)  # from which the masses are not learnt
    scene = Scene(
        robot=ARM, base_wrench=None, joint_torque=nothing, link_wrenches=(sensor,), inertia_error=told
    )
    localizer, energies = Localizer(scene), []
    for sample in stream(scene, 1.0, robot=_with_masses(1.0 + heavier)):
        localizer.step(sample)
        energies.append(float(localizer._buffers.state.no_contact_energy[0]))
    of_masses = 0.5 * np.sum((heavier[FOREARM:] / told) ** 2)
    assert np.median(energies[100:]) > 0.2 * of_masses
    assert max(energies[100:]) < 0.5 * ncx2(6, 2.0 * of_masses).isf(1e-4)


def test_the_sensor_tells_the_links_apart(truth: Truth) -> None:
    """Joint torques cannot tell many touches of the forearm from those below it; the sensor can."""
    chance = np.random.default_rng(5)
    torque = truth.torque + chance.standard_normal(truth.torque.shape)
    wrench = forearm_wrench(truth) + noise(truth, chance)
    plain = Localizer(Scene(robot=ARM, base_wrench=None, joint_torque=TORQUE, link_prior="equal"))
    fitted = Localizer(WITHOUT_BASE.model_copy(update={"link_prior": "equal"}))
    alone = plain.locate_batch(truth.q, joint_torque=torque)
    both = fitted.locate_batch(truth.q, joint_torque=torque, link_wrenches={"forearm": wrench})
    beyond = truth.link >= FOREARM
    right = [float((found.link == truth.link)[beyond].mean()) for found in (alone, both)]
    assert right[1] > right[0] + 0.15
    assert right[1] > 0.8
    # On which side of the sensor a touch is, it says almost surely.
    share = both.link_probability[:, FOREARM:].sum(axis=1)
    assert (share[beyond] > 0.99).mean() > 0.98
    assert both.detected[beyond].mean() > 0.99
    error = np.linalg.norm(both.point_base - truth.point, axis=1)[beyond & (both.link == truth.link)]
    assert np.median(error) < 0.01
    felt = ~beyond & both.detected
    assert (share[felt] < 0.01).mean() > 0.98


def test_the_sensor_helps_beside_a_base_sensor(truth: Truth) -> None:
    chance = np.random.default_rng(6)
    deviation = np.repeat([BASE.force_noise, BASE.moment_noise], 3)
    base = truth.base_wrench + deviation * chance.standard_normal(truth.base_wrench.shape)
    torque = truth.torque + chance.standard_normal(truth.torque.shape)
    wrench = forearm_wrench(truth) + noise(truth, chance)
    given = {"base_wrench": base, "joint_torque": torque}
    alone = Localizer(Scene(robot=ARM, base_wrench=BASE, joint_torque=TORQUE)).locate_batch(truth.q, **given)
    both = Localizer(ALL).locate_batch(truth.q, **given, link_wrenches={"forearm": wrench})
    right = [float((found.link == truth.link).mean()) for found in (alone, both)]
    assert right[1] >= right[0]
    error = [np.linalg.norm(found.point_base - truth.point, axis=1) for found in (alone, both)]
    beyond = truth.link >= FOREARM
    assert np.median(error[1][beyond]) < 0.7 * np.median(error[0][beyond])


@pytest.mark.parametrize("scene", [ALL, WITHOUT_BASE], ids=["all", "without base"])
@pytest.mark.parametrize(
    ("link", "load"),
    [
        ("upper_arm", push_on(2, (-0.2, 0.05, 0.138), (0.0, -30.0, 0.0))),
        ("forearm", push_on(3, (-0.2, 0.04, 0.007), (0.0, -30.0, 0.0))),
        ("wrist_1", push_on(4, (0.045, 0.0, 0.0), (-30.0, 0.0, 0.0))),
    ],
)
def test_a_push_on_a_moving_arm(scene: Scene, link: str, load: Load) -> None:
    found = list(Localizer(scene).run(stream(scene, 2.0, [load], start=1.0, seed=7)))
    assert not any(estimate.contacts for estimate in found[:500])
    late = [estimate for estimate in found[650:] if estimate.contacts]
    if link == "upper_arm" and scene.base_wrench is None:
        # The sensor excludes what it carries; below it, there are the torques of two joints.
        beyond = [float(estimate.link_probability[FOREARM:].sum()) for estimate in late]
        assert max(beyond, default=0.0) < 0.01
        return
    assert len(late) > 250
    right = np.mean([estimate.contacts[0].link == link for estimate in late])
    assert right > 0.9
    force = np.median([np.linalg.norm(estimate.contacts[0].force_base) for estimate in late])
    assert force == pytest.approx(30.0, rel=0.1)


def test_a_recording_in_blocks_is_the_stream(localizer: Localizer) -> None:
    samples = stream(ALL, 1.6, [push_on(3, (-0.2, 0.04, 0.007), (0.0, -30.0, 0.0))], start=1.0)
    one_by_one = list(localizer.run(samples))
    block = SampleBlock(
        *(np.array([getattr(x, name) for x in samples]) for name in ("t", "q", "qd", "joint_torque")),
        np.array([x.base_wrench for x in samples]),
        link_wrenches={"forearm": np.array([(x.link_wrenches or {})["forearm"] for x in samples])},
    )
    (found,) = localizer.run_blocks([block])
    touched = [i for i, estimate in enumerate(one_by_one) if estimate.contacts]
    assert len(touched) > 200
    np.testing.assert_array_equal(found.sample, touched)
    probability = [one_by_one[i].contacts[0].probability for i in touched]
    np.testing.assert_allclose(found.rows[:, 2], probability, atol=1e-6)


def test_a_silent_or_saturated_sensor_is_told_and_not_used() -> None:
    sensor = SENSOR.model_copy(update={"range": (400.0, 60.0)})
    localizer = Localizer(ALL.model_copy(update={"link_wrenches": (sensor,)}))
    samples = stream(ALL, 0.8)
    beyond = LinkSensorFrame(localizer.scene, FIELD)
    for i in range(200, 300):
        samples[i] = replace(samples[i], link_wrenches=None)
    for i in range(300, 320):
        wrong = beyond.wrench(samples[i].q, np.array([0.0, 450.0, 0.0, 0.0, 0.0, 0.0]))
        samples[i] = replace(samples[i], link_wrenches={"forearm": wrong})
    for i in range(320, 340):
        samples[i] = replace(samples[i], link_wrenches={"forearm": np.full(6, np.nan)})
    for i in range(340, 350):
        masked = np.ma.masked_array(np.full(6, 1e20), mask=True)
        samples[i] = replace(samples[i], link_wrenches={"forearm": masked})
    found = list(localizer.run(samples))
    assert found[199].status == "none"
    for i in (250, 299):
        assert (found[i].status, found[i].reason) == ("degraded", f"{FIELD} is missing")
    assert f"{FIELD}: expected a reading within the sensor's range, below 400 N in fy" in found[310].reason
    assert f"{FIELD}" in found[330].reason
    assert found[345].reason == found[330].reason
    assert found[-1].status == "none"
    assert not any(estimate.contacts for estimate in found)


def test_arguments_are_checked(localizer: Localizer) -> None:
    zero = {"base_wrench": ZERO, "joint_torque": ZERO}
    with pytest.raises(ValueError, match=r"^link_wrenches\.elbow: the scene has no such sensor"):
        localizer.locate(Q, **zero, link_wrenches={"elbow": ZERO})
    with pytest.raises(ValueError, match=r"^link_wrenches\.forearm: expected shape \(6,\)"):
        localizer.locate(Q, **zero, link_wrenches={"forearm": np.zeros(5)})
    with pytest.raises(ValueError, match=r"^link_wrenches\.forearm: expected finite"):
        localizer.locate(Q, **zero, link_wrenches={"forearm": np.full(6, np.nan)})
    with pytest.raises(ValueError, match=r"^link_wrenches\.forearm: expected shape \(1, 6\)"):
        localizer.locate_batch(Q[None], base_wrench=ZERO[None], link_wrenches={"forearm": np.zeros((2, 6))})
    with pytest.raises(ValueError, match=r"^link_wrenches\.forearm: expected shape \(6,\)"):
        localizer.step(Sample(0.0, Q, ZERO, ZERO, ZERO, link_wrenches={"forearm": np.zeros(4)}))
    # A single sensor's value in place of values by name.
    block = SampleBlock(np.arange(3.0), np.tile(Q, (3, 1)), np.zeros((3, 6)), link_wrenches=np.zeros((3, 6)))  # type: ignore[arg-type]
    for call in (
        lambda: localizer.locate(Q, **zero, link_wrenches=ZERO),
        lambda: localizer.locate(Q, **zero, link_wrenches=[ZERO]),
        lambda: localizer.step(Sample(0.0, Q, ZERO, ZERO, ZERO, link_wrenches=ZERO)),
        lambda: list(localizer.run_blocks([block])),
    ):
        with pytest.raises(
            TypeError, match=r"^link_wrenches: expected values by name .*, got (ndarray|list)$"
        ):
            call()


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (
            {"name": "a", "link": "elbow"},
            r"^link_wrenches\[0\]\.link: expected one of shoulder, .*got 'elbow'",
        ),
        ({"name": "a", "link": "base"}, r"^link_wrenches\[0\]\.link: expected one of shoulder"),
        (
            {"name": "Elbow 1", "link": "forearm"},
            r"^link_wrenches\[0\]\.name: expected small letters.*'Elbow 1'$",
        ),
        ({"name": "wrist", "link": "forearm"}, r"^link_wrenches\[0\]\.name: expected a name other than base"),
        ({"link": "forearm"}, r"^link_wrenches\[0\]\.name: expected a value, the field is missing"),
    ],
)
def test_wrong_scenes_are_explained(sensor: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scene(robot=ARM, link_wrenches=[sensor])


def test_names_are_given_once() -> None:
    with pytest.raises(SceneError, match=r"^link_wrenches\[1\]\.name: expected a name that no other sensor"):
        Scene(robot=ARM, link_wrenches=[SENSOR, SENSOR])


def test_several_sensors_and_a_wrist_sensor_go_together() -> None:
    """The exact wrench of a push on the tool is felt by all of them, that of one on the forearm by two."""
    tool = Tool(mass=0.5, com=(0, 0, 0.05), primitives=ARM.links[6].primitives)
    wrist = SENSOR.model_copy(update={"name": "wrist_1", "link": "wrist_1"})
    scene = ALL.model_copy(
        update={"link_wrenches": (wrist, SENSOR), "tool": tool, "wrist_wrench": WrenchSensor()}
    )
    localizer = Localizer(scene)
    given = contacts(ARM, 40, seed=2)
    for i in np.flatnonzero(given.link >= FOREARM):
        w = given.base_wrench[i]
        found = localizer.locate(
            given.q[i],
            base_wrench=w,
            joint_torque=given.torque[i],
            wrist_wrench=ZERO,
            link_wrenches={"forearm": w, "wrist_1": w if given.link[i] >= 4 else ZERO},
        )
        beyond = found.link_probability[4:7].sum()
        assert beyond > 0.99 if given.link[i] >= 4 else beyond < 0.01
        assert found.link_probability[7] < 1e-6
