"""Implausible measurements are refused with the field, what was expected and what was received."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor, forward_model
from contactsense.benchmarks.motion.model_error import heavier
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.tool import Tool
from contactsense.scene_model.arm_weight import ArmWeight
from tests.plain_arm import contacts, plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
PUSH = forward_model(
    Scene(robot=ARM), Q, "forearm", np.array([-0.2, 0.0, 0.047]), np.array([0, 0, -20.0]), external=True
)
RAW = forward_model(Scene(robot=ARM), Q, "forearm", np.array([-0.2, 0.0, 0.047]), np.array([0, 0, -20.0]))


def test_the_weight_is_that_of_inverse_dynamics() -> None:
    scene = Scene(robot="ur10e", mounting=(0.2, -0.5, 1.0), tool=Tool(mass=2.0, com=(0.01, 0.02, 0.1)))
    nothing = forward_model(scene, Q, "base", np.zeros(3), np.zeros(3)).base_wrench
    np.testing.assert_allclose(ArmWeight(scene).wrench(Q), nothing, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"q": np.degrees(Q)},
            r"^q: expected positions in rad, \w+ within -\S+ to \S+, got -74\.\d+; are they in deg",
        ),
        ({"q": Q + 400.0}, r"^q: expected positions in rad"),
        (
            {"base_wrench": np.array([0, 0, 19e3, 0, 0, 0])},
            r"^base_wrench: .* below 52\d\d N in fz, got 19000 N",
        ),
        (
            {"base_wrench": np.array([0, 0, 0, 0, 9e3, 0])},
            r"^base_wrench: .* below 52\d\d Nm in my, got 9000 Nm",
        ),
        (
            {"joint_torque": np.array([0, 400.0, 0, 0, 0, 0])},
            r"^joint_torque: expected at most 2.5 times the 150 Nm",
        ),
        (
            {"base_wrench": RAW.base_wrench},
            r"^base_wrench: .*as external is true, got the arm's own weight of 213 N",
        ),
        (
            {"base_wrench": -RAW.base_wrench},
            r"^base_wrench: .*as external is true, got .* weight of 213 N with the opposite sign",
        ),
        (
            {"external": False},
            r"^base_wrench: expected a raw reading .*, got \(0.0, 0.0, -20.0\) N; is the sensor",
        ),
        (
            {"base_wrench": -RAW.base_wrench, "external": False},
            r"^base_wrench: expected a raw reading .*opposite sign \(base_wrench.sign\)",
        ),
        (
            {"base_wrench": RAW.base_wrench, "joint_torque": np.full(6, 50.0), "external": False},
            r"^joint_torque: expected at most 1.5 times the 28 Nm of \w+, got 50 Nm",
        ),
    ],
)
def test_what_cannot_be_is_refused(ordinary: Localizer, changes: dict[str, object], message: str) -> None:
    given = {
        "q": Q,
        "base_wrench": PUSH.base_wrench,
        "joint_torque": PUSH.joint_torque,
        "external": True,
    } | changes
    with pytest.raises(ValueError, match=message):
        ordinary.locate(**given)  # type: ignore[arg-type]
    rows = {name: value if name == "external" else np.stack([value] * 2) for name, value in given.items()}
    rows["q"][0] = Q
    field = message[1 : message.index(":")]
    with pytest.raises(ValueError, match=rf"^{field}\[\d\]{message[message.index(':') :]}"):
        ordinary.locate_batch(**rows)  # type: ignore[arg-type]


def test_known_contacts_are_located_whatever_the_measurements_are() -> None:
    """As `locate` does with `detect=False`: noise may take the torque of a weak joint beyond its limit."""
    localizer = Localizer(Scene(robot=ARM, joint_torque=JointTorqueSensor(noise=20.0)))
    torque = RAW.joint_torque + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 50.0])
    rows = {"base_wrench": RAW.base_wrench[None], "joint_torque": torque[None], "external": False}
    with pytest.raises(ValueError, match=r"^joint_torque\[0\]: expected at most"):
        localizer.locate_batch(Q[None], **rows)
    found = localizer.locate_batch(Q[None], **rows, detect=False)
    alone = localizer.locate(
        Q, base_wrench=RAW.base_wrench, joint_torque=torque, external=False, detect=False
    ).contacts[0]
    assert found.link[0] == alone.link_index
    np.testing.assert_allclose(found.point_base[0], alone.point_base, atol=1e-6)


def test_an_infinite_position_is_none_in_degrees() -> None:
    found = PlausibleLimits(Scene(robot=ARM)).position(np.where(np.arange(6) == 2, np.inf, Q))
    assert found is not None
    assert found.reason == "expected finite positions, got inf for elbow_joint"


def test_what_can_be_is_located(ordinary: Localizer) -> None:
    assert ordinary.locate(Q, base_wrench=PUSH.base_wrench, joint_torque=PUSH.joint_torque).contacts
    raw = ordinary.locate(Q, base_wrench=RAW.base_wrench, joint_torque=RAW.joint_torque, external=False)
    assert raw.contacts[0].link == "forearm"
    another_turn = Q + 2.0 * np.pi * np.array([1, -1, 0, 1, 0, -1])
    assert ordinary.locate(
        another_turn, base_wrench=PUSH.base_wrench, joint_torque=PUSH.joint_torque
    ).contacts


def test_no_ordinary_contact_is_refused() -> None:
    """5 to 60 N anywhere on the arm, as share of the contact and with the arm's weight."""
    truth, limits = contacts(ARM, 300, 5), PlausibleLimits(Scene(robot=ARM))
    weight = np.array([limits.weight.wrench(q) for q in truth.q])
    for external, wrench in ((True, truth.base_wrench), (False, truth.base_wrench + weight)):
        torque = truth.torque if external else None
        assert limits.suspects(truth.q, wrench, torque, {}, external).size == 0
        for i in range(len(wrench)):
            one = None if torque is None else torque[i]
            assert limits.request(truth.q[i], wrench[i], one, {}, external) is None


@pytest.mark.parametrize("mass", [0.25, 0.5, 1.0])
def test_a_push_as_large_as_the_weight_is_refused_on_heavy_arms_only(mass: float) -> None:
    """It cancels the weight, like a sensor that was tared: 53, 106 and 213 N."""
    limits = PlausibleLimits(Scene(robot=heavier(ARM, mass - 1.0)))
    weight = limits.weight.wrench(Q)
    force = np.array([5.0, 3.0, 1.0]) - weight[:3]
    push = np.concatenate((force, np.cross([0.1, 0.0, 0.3], force)))
    found = limits.request(Q, weight + push, None, {}, False)
    if mass < 0.5:
        assert found is None
    else:
        assert found is not None
        assert "is the sensor tared" in found.reason
    for given, external in ((push, True), (weight + 0.1 * push, False)):
        assert limits.request(Q, given, None, {}, external) is None


def test_readings_beyond_the_sensors_range_are_refused() -> None:
    """In the sensor's own frame, with the arm's weight: half a metre above it, a force is a moment on it."""
    sensor = WrenchSensor(range=(400.0, 400.0, 800.0, 60.0, 60.0, 60.0), translation=(0.0, 0.0, -0.5))
    limits = PlausibleLimits(Scene(robot=ARM, base_wrench=sensor))
    push = np.array([-150.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    weight = limits.weight.wrench(Q)
    assert limits.request(Q, 0.1 * push, None, {}, True) is None
    assert limits.request(Q, weight + 0.1 * push, None, {}, False) is None
    for wrench, external in ((push, True), (weight + push, False)):
        found = limits.request(Q, wrench, None, {}, external)
        assert found is not None
        assert found.field == "base_wrench"
        assert "within the sensor's range, below 60 Nm in my" in found.reason
