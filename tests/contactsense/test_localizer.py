"""The whole sample path on constructed truth: static, batch, live stream, bad input."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots.primitives import Capsule
from contactsense.robots.tool import Tool
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
TRUTH = contacts(ARM, 300, seed=1)
PRECISE = Scene(
    robot=ARM,
    base_wrench=WrenchSensor(force_noise=0.002, moment_noise=0.0004),
    joint_torque=JointTorqueSensor(noise=0.002),
    surface_error=1e-4,
)


@pytest.fixture(scope="module")
def precise() -> Localizer:
    return Localizer(PRECISE)


@pytest.fixture(scope="module")
def ordinary() -> Localizer:
    return Localizer(Scene(robot=ARM))


def _weight(q: np.ndarray, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    torque, wrench, motion = np.empty(6), np.empty(6), empty_motion(6)
    zero = np.zeros(6)
    inverse_dynamics(build_model(scene.robot), q, zero, zero, scene.gravity_base, motion, torque, wrench)
    return torque, wrench


def test_precise_sensors_find_link_point_force_and_torsion(precise: Localizer) -> None:
    found = precise.locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    right = found.link == TRUTH.link
    assert right.mean() > 0.99
    error = np.linalg.norm(found.point_base - TRUTH.point, axis=1)[right]
    # A wrench may pass through two places of one link; all but a few contacts are unambiguous.
    assert np.median(error) < 1e-4
    assert np.quantile(error, 0.95) < 1e-3
    good = right & (np.linalg.norm(found.point_base - TRUTH.point, axis=1) < 1e-3)
    np.testing.assert_allclose(found.force_base[good], TRUTH.force[good], atol=0.05)
    np.testing.assert_allclose(found.torsion[good], TRUTH.torsion[good], atol=0.02)
    assert np.median(np.sum(found.normal_base[good] * TRUTH.normal[good], axis=1)) > 0.9999
    assert found.detected.all()


def test_one_sample_and_a_batch_give_the_same_answer(ordinary: Localizer) -> None:
    batch = ordinary.locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    for i in range(20):
        one = ordinary.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        best = one.contacts[0]
        assert best.link_index == batch.link[i]
        np.testing.assert_array_equal(best.point_base, batch.point_base[i])
        np.testing.assert_array_equal(best.force_base, batch.force_base[i])
        np.testing.assert_array_equal(one.link_probability, batch.link_probability[i])
        assert best.probability == batch.probability[i]


def test_probabilities_are_of_one_whole_and_sorted(ordinary: Localizer) -> None:
    for i in range(50):
        one = ordinary.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        p = [contact.probability for contact in one.contacts]
        assert p == sorted(p, reverse=True)
        assert sum(p) + one.other == pytest.approx(1.0)
        assert 0.5 < one.link_probability.sum() <= 1.0 + 1e-12
        assert one.status == ("contact" if p[0] >= 0.95 else "ambiguous")


def test_the_point_in_the_link_frame_is_the_point_in_the_base_frame(precise: Localizer) -> None:
    motion, model = empty_motion(6), build_model(ARM)
    for i in range(20):
        one = precise.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        best = one.contacts[0]
        forward_kinematics(model, TRUTH.q[i], motion)
        back = motion.rotation[best.link_index] @ best.point + motion.origin[best.link_index]
        np.testing.assert_allclose(back, best.point_base, atol=1e-12)
        assert best.link == ARM.link_names[best.link_index]
        assert np.linalg.norm(best.normal_base) == pytest.approx(1.0)
        assert best.force_base @ best.normal_base < 0.0
        assert np.linalg.eigvalsh(best.covariance).min() > -1e-18


@pytest.mark.parametrize("mounting", ["table", "ceiling", "wall", (0.4, -0.2, 1.0)])
def test_gravity_is_compensated_for_every_mounting(mounting: str | tuple[float, float, float]) -> None:
    scene = PRECISE.model_copy(update={"mounting": mounting})
    localizer = Localizer(scene)
    for i in range(5):
        torque, wrench = _weight(TRUTH.q[i], scene)
        a = localizer.locate(
            TRUTH.q[i],
            base_wrench=TRUTH.base_wrench[i] + wrench,
            joint_torque=TRUTH.torque[i] + torque,
            external=False,
        )
        b = localizer.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        np.testing.assert_allclose(a.contacts[0].point_base, b.contacts[0].point_base, atol=1e-6)
        assert a.contacts[0].link == b.contacts[0].link


def test_rotation_about_the_base_axis_rotates_the_estimate(ordinary: Localizer) -> None:
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for i in range(20):
        q = TRUTH.q[i].copy()
        q[0] += angle
        wrench = np.concatenate((turn @ TRUTH.base_wrench[i, :3], turn @ TRUTH.base_wrench[i, 3:]))
        a = ordinary.locate(TRUTH.q[i], base_wrench=TRUTH.base_wrench[i], joint_torque=TRUTH.torque[i])
        b = ordinary.locate(q, base_wrench=wrench, joint_torque=TRUTH.torque[i])
        # The base link does not turn with the joint, but it is round: a contact on it turns along.
        assert a.contacts[0].link == b.contacts[0].link
        np.testing.assert_allclose(turn @ a.contacts[0].point_base, b.contacts[0].point_base, atol=2e-4)


def test_more_force_and_more_noise_in_proportion_change_nothing() -> None:
    scene = Scene(robot=ARM, surface_error=1e-4)
    assert scene.base_wrench is not None
    joints = tuple(replace(joint, torque_limit=1e3 * joint.torque_limit) for joint in ARM.joints)
    louder = scene.model_copy(
        update={
            "robot": replace(ARM, joints=joints),
            "base_wrench": WrenchSensor(force_noise=250.0, moment_noise=50.0, range=(1e6, 1e6)),
            "joint_torque": JointTorqueSensor(noise=1000.0),
            "force": 1e3 * scene.force,
        }
    )
    a = Localizer(scene).locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    b = Localizer(louder).locate_batch(
        TRUTH.q, base_wrench=1e3 * TRUTH.base_wrench, joint_torque=1e3 * TRUTH.torque
    )
    np.testing.assert_array_equal(a.link, b.link)
    np.testing.assert_allclose(a.point_base, b.point_base, atol=1e-6)
    np.testing.assert_allclose(1e3 * a.force_base, b.force_base, atol=1e-3)


def test_geometry_resolves_the_ambiguity_of_the_torques() -> None:
    """At ordinary noise the joint decision finds the link far more often than the torques' evidence alone."""
    chance = np.random.default_rng(8)
    truth = contacts(ARM, 600, seed=9)
    wrench = truth.base_wrench + chance.standard_normal((600, 6)) * np.array([0.25] * 3 + [0.05] * 3)
    torque = truth.torque + chance.standard_normal((600, 6))
    right = {}
    for method in ("joint", "torques_first"):
        found = Localizer(Scene(robot=ARM, surface_error=1e-4), method).locate_batch(
            truth.q, base_wrench=wrench, joint_torque=torque
        )
        right[method] = np.mean(found.link == truth.link)
    assert right["joint"] > 0.85
    assert right["joint"] > right["torques_first"] + 0.2


@pytest.mark.parametrize("sensors", ["base", "torques"])
def test_either_sensor_alone_gives_an_estimate(sensors: str) -> None:
    scene = PRECISE.model_copy(update={"joint_torque" if sensors == "base" else "base_wrench": None})
    given = {"base_wrench": TRUTH.base_wrench} if sensors == "base" else {"joint_torque": TRUTH.torque}
    found = Localizer(scene).locate_batch(TRUTH.q, **given)
    assert np.isfinite(found.point_base).all()
    beyond = TRUTH.link >= (0 if sensors == "base" else 5)
    error = np.linalg.norm(found.point_base - TRUTH.point, axis=1)[beyond]
    right = (found.link == TRUTH.link)[beyond]
    if sensors == "base":
        assert np.median(error) < 1e-3
        assert right.mean() > 0.8
    else:
        assert right.mean() > 0.6


def test_a_wrist_sensor_distinguishes_tool_from_wrist() -> None:
    tool = Tool(
        name="finger",
        mass=0.5,
        com=(0, 0, 0.1),
        primitives=(Capsule(a=(0, 0, 0.03), b=(0, 0, 0.2), radius=0.015),),
    )
    scene = PRECISE.model_copy(
        update={"tool": tool, "wrist_wrench": WrenchSensor(force_noise=0.1, moment_noise=0.01)}
    )
    localizer = Localizer(scene)
    q = np.array([0.3, -1.2, 1.5, -1.0, -1.4, 0.4])
    motion = empty_motion(6)
    forward_kinematics(build_model(ARM), q, motion)
    flange = motion.rotation[6] @ ARM.flange_rotation
    origin = motion.rotation[6] @ ARM.flange_translation + motion.origin[6]
    point = flange @ np.array([0.015, 0.0, 0.15]) + origin
    force = flange @ np.array([-12.0, 1.0, 2.0])
    wrench = np.concatenate((force, np.cross(point, force)))
    found = localizer.locate(q, base_wrench=wrench, joint_torque=-motion.screw @ wrench, wrist_wrench=wrench)
    assert found.contacts[0].link == "finger"
    np.testing.assert_allclose(found.contacts[0].point, [0.015, 0.0, 0.15], atol=1e-3)
    assert len(found.link_probability) == 8
    # A push along the finger enters its tip and, further along the same line, the wrist: only the wrist
    # sensor knows.
    point = flange @ np.array([0.004, 0.0, 0.2]) + origin
    force = flange @ np.array([0.0, 0.0, -15.0])
    wrench = np.concatenate((force, np.cross(point, force)))
    both = {"base_wrench": wrench, "joint_torque": -motion.screw @ wrench}
    assert localizer.locate(q, **both, wrist_wrench=wrench).contacts[0].link == "finger"
    below = localizer.locate(q, **both, wrist_wrench=np.zeros(6))
    assert below.contacts[0].link in {"wrist_2", "wrist_3"}
    assert below.link_probability[7] < 1e-6


def test_links_that_cannot_be_touched_are_never_named() -> None:
    scene = PRECISE.model_copy(update={"touchable": ("forearm", "wrist_1")})
    found = Localizer(scene).locate_batch(TRUTH.q, base_wrench=TRUTH.base_wrench, joint_torque=TRUTH.torque)
    assert set(found.link.tolist()) <= {-1, 3, 4}


def test_the_face_on_which_the_base_stands_cannot_be_touched(precise: Localizer) -> None:
    wrench = np.array([0.0, 0.0, 30.0, 0.3, -0.2, 0.0])  # upwards, through the base
    found = precise.locate(np.zeros(6), base_wrench=wrench, joint_torque=np.zeros(6))
    assert all(c.point_base[2] > 1e-3 or c.normal_base[2] > -0.5 for c in found.contacts)


def test_noise_alone_is_no_contact_at_the_stated_rate() -> None:
    scene = Scene(robot=ARM, false_alarms_per_hour=0.01 * 3600.0 * 2.0 * np.pi * 10.0)
    chance = np.random.default_rng(2)
    n = 4000
    found = Localizer(scene).locate_batch(
        chance.uniform(-3, 3, (n, 6)),
        base_wrench=chance.standard_normal((n, 6)) * np.array([0.25] * 3 + [0.05] * 3),
        joint_torque=chance.standard_normal((n, 6)),
    )
    # 40 expected of 4000: six standard deviations either way.
    assert 8 <= found.detected.sum() <= 78


def test_zero_measurement_is_no_contact(ordinary: Localizer) -> None:
    quiet = ordinary.locate(np.zeros(6), base_wrench=np.zeros(6), joint_torque=np.zeros(6))
    assert quiet.status == "none"
    assert quiet.contacts == ()
    assert quiet.link_probability.sum() == 0.0


def test_a_contact_known_to_be_there_is_looked_for_below_the_threshold(ordinary: Localizer) -> None:
    weak = 0.01 * TRUTH.base_wrench[0]
    assert ordinary.locate(TRUTH.q[0], base_wrench=weak).status == "none"
    assert ordinary.locate(TRUTH.q[0], base_wrench=weak, detect=False).contacts


class TestStream:
    """`step` on a stream of samples of a held posture."""

    q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])

    def _samples(self, count: int, wrench: np.ndarray, link: int, first: int = 100) -> list[Sample]:
        torque, weight = _weight(self.q, PRECISE)
        motion = empty_motion(6)
        forward_kinematics(build_model(ARM), self.q, motion)
        pushed = np.where(np.arange(6) < link, -motion.screw @ wrench, 0.0)
        zero = np.zeros(6)
        return [
            Sample(
                0.002 * i,
                self.q,
                zero,
                torque + (pushed if i >= first else 0.0),
                weight + (wrench if i >= first else 0.0),
            )
            for i in range(count)
        ]

    def _push(self) -> tuple[np.ndarray, np.ndarray]:
        """A push on the forearm's tube: contact point and wrench, base frame."""
        motion = empty_motion(6)
        forward_kinematics(build_model(ARM), self.q, motion)
        R, o = motion.rotation[3], motion.origin[3]
        point = R @ np.array([-0.2, 0.04, 0.007]) + o
        force = R @ np.array([1.0, -20.0, 0.0])
        return point, np.concatenate((force, np.cross(point, force)))

    def test_silence_then_the_contact(self, precise: Localizer) -> None:
        point, wrench = self._push()
        estimates = list(precise.run(self._samples(400, wrench, 3)))
        assert estimates[0].status == "degraded"
        assert "settling" in estimates[0].reason
        assert {e.status for e in estimates[45:100]} == {"none"}
        assert estimates[-1].status == "contact"
        assert estimates[-1].contacts[0].link == "forearm"
        np.testing.assert_allclose(estimates[-1].contacts[0].point_base, point, atol=1e-3)
        np.testing.assert_allclose(estimates[-1].wrench, wrench, atol=0.02)
        onset = next(i for i, e in enumerate(estimates) if e.contacts)
        assert 100 <= onset <= 105

    def test_a_sensor_that_falls_silent_is_named_and_the_others_go_on(self, precise: Localizer) -> None:
        _, wrench = self._push()
        samples = self._samples(400, wrench, 3)
        for i in range(200, 300):
            samples[i] = Sample(samples[i].t, samples[i].q, samples[i].qd, samples[i].joint_torque, None)
        estimates = list(precise.run(samples))
        assert estimates[290].status == "degraded"
        assert "base_wrench is missing" in estimates[290].reason
        assert estimates[290].contacts
        assert estimates[-1].status == "contact"

    @pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench", "t"])
    def test_nan_spoils_one_sample_only(self, precise: Localizer, field: str) -> None:
        _, wrench = self._push()
        samples = self._samples(300, wrench, 3)
        clean = list(precise.run(samples))
        bad = samples[250]
        values = {name: getattr(bad, name) for name in ("t", "q", "qd", "joint_torque", "base_wrench")}
        values[field] = float("nan") if field == "t" else np.where(np.arange(6) == 2, np.nan, values[field])
        samples[250] = Sample(**values)
        estimates = list(precise.run(samples))
        assert estimates[250].status == "degraded"
        assert "not finite" in estimates[250].reason
        assert estimates[-1].status == clean[-1].status
        np.testing.assert_allclose(
            estimates[-1].contacts[0].point_base, clean[-1].contacts[0].point_base, atol=1e-4
        )

    def test_a_repeated_sample_is_not_used_twice(self, precise: Localizer) -> None:
        _, wrench = self._push()
        samples = self._samples(200, wrench, 3)
        estimates = list(precise.run([*samples, samples[-1]]))
        assert estimates[-1].status == "degraded"
        assert "same time" in estimates[-1].reason

    def test_time_that_jumps_back_starts_a_new_stream(self, precise: Localizer) -> None:
        _, wrench = self._push()
        samples = self._samples(300, wrench, 3)
        again = list(precise.run([*samples, *samples]))
        assert "settling" in again[300].reason
        np.testing.assert_array_equal(again[299].contacts[0].point_base, again[-1].contacts[0].point_base)

    def test_wrong_shapes_are_named(self, precise: Localizer) -> None:
        with pytest.raises(ValueError, match=r"joint_torque: expected shape \(6,\), got shape \(5,\)"):
            precise.step(Sample(0.0, self.q, np.zeros(6), np.zeros(5)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"base_wrench": [0.0] * 5}, r"base_wrench: expected shape \(6,\)"),
        (
            {"base_wrench": [0.0, 1.0, np.nan, 0.0, 0.0, 0.0]},
            r"base_wrench: expected finite numbers, got nan at index \[2\]",
        ),
        ({"joint_torque": "strong"}, "joint_torque: expected numbers, got 'strong'"),
        ({}, "expected at least one of the two, got none"),
        ({"base_wrench": [0.0] * 6, "wrist_wrench": [0.0] * 6}, "wrist_wrench: the scene has no such sensor"),
    ],
)
def test_bad_arguments_are_named(ordinary: Localizer, arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ordinary.locate(np.zeros(6), **arguments)  # type: ignore[arg-type]


def test_batches_must_be_of_one_length(ordinary: Localizer) -> None:
    with pytest.raises(
        ValueError, match=r"base_wrench: expected shape \(4, 6\) in N, Nm, got shape \(3, 6\)"
    ):
        ordinary.locate_batch(np.zeros((4, 6)), base_wrench=np.zeros((3, 6)))


def test_samples_may_be_lists_read_only_or_views(precise: Localizer) -> None:
    """What a field holds counts, not how it is kept; and what a caller does with it afterwards is his."""
    torque, weight = _weight(TestStream.q, PRECISE)
    plain = [Sample(0.002 * i, TestStream.q, np.zeros(6), torque, weight) for i in range(60)]
    fixed = weight.copy()
    fixed.setflags(write=False)
    zeros = np.zeros((6, 2))[:, 1]
    listed = TestStream.q.tolist()
    others = [Sample(s.t, listed, zeros, torque.astype(object), fixed) for s in plain]
    expected = [estimate.status for estimate in precise.run(plain)]
    assert [estimate.status for estimate in precise.run(others)] == expected
    assert expected[-1] == "none"


@pytest.mark.parametrize("kind", ["<f4", ">f8", "i8", "O", "pickled", "subclass"])
def test_values_of_any_type_are_converted(ordinary: Localizer, kind: str) -> None:
    """Machine code that takes eight bytes for a float would read other numbers."""
    q = np.array([0.0, -1.0, 2.0, -2.0, -1.0, 0.0])
    torque, wrench = _weight(q, ordinary.scene)
    torque, wrench = np.round(torque), np.round(wrench + np.array([0.0, 25.0, 0.0, 4.0, 0.0, 0.0]))

    def other(values: np.ndarray) -> np.ndarray:
        if kind == "pickled":
            found: np.ndarray = pickle.loads(pickle.dumps(values))
            return found
        return values.view(np.recarray) if kind == "subclass" else values.astype(kind)

    expected = ordinary.locate(q, base_wrench=wrench, joint_torque=torque, external=False, detect=False)
    found = ordinary.locate(
        other(q), base_wrench=other(wrench), joint_torque=other(torque), external=False, detect=False
    )
    assert np.linalg.norm(found.wrench) > 20.0
    np.testing.assert_array_equal(found.wrench, expected.wrench)
    samples = [Sample(0.002 * i, q, 0.0 * q, torque, wrench) for i in range(80)]
    others = [Sample(s.t, other(q), other(0.0 * q), other(torque), other(wrench)) for s in samples]
    one, two = list(ordinary.run(samples))[-1], list(ordinary.run(others))[-1]
    assert np.linalg.norm(one.wrench) > 20.0
    np.testing.assert_array_equal(one.wrench, two.wrench)


@pytest.mark.parametrize("shape", [(6, 1), (1, 6), (), (2, 3), (1,) * 9 + (6,), (6, 6)])
@pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench"])
def test_fields_that_are_no_vectors_are_named(
    ordinary: Localizer, field: str, shape: tuple[int, ...]
) -> None:
    """Also after the start of a stream, where its readings go to the machine code first."""
    torque, wrench = _weight(TestStream.q, ordinary.scene)
    fields = {"q": TestStream.q, "qd": np.zeros(6), "joint_torque": torque, "base_wrench": wrench}
    for _ in ordinary.run([Sample(0.002 * i, **fields) for i in range(60)]):
        pass
    fields[field] = np.zeros(shape)
    with pytest.raises(ValueError, match=rf"{field}: expected shape \(6,\), got shape"):
        ordinary.step(Sample(1.0, **fields))
    del fields["qd"]
    if field != "qd":
        with pytest.raises(ValueError, match=rf"{field}: expected shape \(6,\)"):
            ordinary.locate(**fields, external=False)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [np.float64(1.0), b"abc"])
@pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench"])
def test_a_field_of_the_first_sample_that_is_no_vector_is_named(
    ordinary: Localizer, field: str, value: Any
) -> None:
    torque, wrench = _weight(TestStream.q, ordinary.scene)
    fields = {"q": TestStream.q, "qd": np.zeros(6), "joint_torque": torque, "base_wrench": wrench}
    ordinary.reset()
    with pytest.raises(ValueError, match=rf"{field}: expected"):
        ordinary.step(Sample(0.0, **{**fields, field: value}))


def test_an_unusable_first_sample_rules_nothing_out(precise: Localizer) -> None:
    """Whatever could be used before it, in another stream or when the kernels were loaded."""
    torque, wrench = _weight(TestStream.q, PRECISE)
    list(precise.run([Sample(0.002 * i, TestStream.q, np.zeros(6), torque, wrench) for i in range(60)]))
    precise.reset()
    first = precise.step(Sample(0.0, np.full(6, np.nan), np.zeros(6), torque, wrench))
    assert first.status == "degraded"
    assert first.detectable == np.inf


def test_estimates_without_contact_are_read_only(precise: Localizer) -> None:
    """They share their arrays: a change in one would be a change in all."""
    quiet = precise.locate(np.zeros(6), base_wrench=np.zeros(6), joint_torque=np.zeros(6))
    for array in (quiet.link_probability, quiet.wrench, quiet.covariance):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
