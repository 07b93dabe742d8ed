"""Simulated cells, and the mistakes that people make when they describe them.

The dynamics are the mock's, which share no code with the estimator's. The arm's true inertia differs from the
robot's data, and every cell has its own mounting, tool, sensor frame, biases and friction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense import JointTorqueSensor, Scene, WrenchSensor, robots
from contactsense.benchmarks.calibration.link_load import with_load
from contactsense.benchmarks.calibration.link_sensor_draws import (
    LINK_MISTAKES,
    Mistake,
    direction,
    with_sensor,
)
from contactsense.benchmarks.calibration.simulate import Motion, Push, arm_of, simulate
from contactsense.calibration import FreeMotion
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.robots.rotations import rpy_from_rotation
from contactsense.robots.tool import Tool
from contactsense.sensors.settings import Friction, LinkInertia
from contactsense.setup_check import Line

_CENTER = np.array([0.0, -1.3, 1.5, -1.0, 0.8, 0.0])
_CONSTANTS = (10.0, 10.7, 8.46, 9.0, 9.48, 10.12)
"""Joint torque per current of a UR10e [Nm/A]."""
_SIGNALS = ("actual_current_as_torque", "actual_current")
_OTHER_ARM = {"ur5e": "ur10e", "ur10e": "ur16e", "ur3e": "ur5e", "ur16e": "ur10e", "ur20": "ur10e"}


@dataclass(frozen=True)
class Settings:
    """How the cells are drawn."""

    seconds: float = 15.0
    """Length of a motion [s]."""
    rate: float = 125.0
    """Samples per second [Hz]."""
    speed: float = 0.3
    """Root mean square of each joint's velocity [rad/s]."""
    postures: int = 0
    """If positive, the arm rests in this number of postures for half of the time, instead of steady
    motion."""
    inertia_error: float = 0.03
    """Standard deviation of each link's true mass about the robot's data, relative; its centre of mass moves
    by the same fraction of the radius of gyration."""


@dataclass(frozen=True)
class Postures:
    """From posture to posture by quintic polynomials, with rests between that take as long as the moves."""

    stops: np.ndarray
    """Joint positions, shape (K, n) [rad]."""
    period: float
    """Length of the motion [s]."""

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions [rad], velocities [rad/s] and accelerations [rad/s^2] at times t, shape (N, n) each."""
        count = len(self.stops)
        span = self.period / (2.0 * count - 1.0)
        place = np.clip(t, 0.0, self.period - 1e-9) / (2.0 * span)
        first = np.minimum(place.astype(int), count - 1)
        u = np.clip(2.0 * (place - first) - 1.0, 0.0, 1.0)[:, None]
        way = self.stops[np.minimum(first + 1, count - 1)] - self.stops[first]
        q = self.stops[first] + way * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2))
        qd = way * (30.0 * u**2 * (1.0 - u) ** 2) / span
        return q, qd, way * (60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)) / span**2


@dataclass(frozen=True)
class Case:
    """A scene to be checked, and a recording as it would be read under it."""

    scene: Scene
    recording: FreeMotion
    line: Line | None
    """The wrong line; None: the scene is right."""


def right_setup(arm: str, seed: int, settings: Settings, sensor: str = "") -> Case:
    """A scene without a mistake; `sensor`: with this sensor within the arm, a key of `LINK_MISTAKES`."""
    rng = np.random.default_rng(seed)
    truth = cell(arm, rng)
    if sensor:
        truth = with_sensor(truth, sensor, rng)
    return Case(truth, recorded(truth, rng, settings), None)


def wrong_setup(kind: str, arm: str, seed: int, settings: Settings, sensor: str = "") -> Case:
    """A scene with one mistake of the kind, a key of `MISTAKES`, or of `LINK_MISTAKES` of this sensor."""
    rng = np.random.default_rng(seed)
    truth = cell(arm, rng)
    line, mistake = (LINK_MISTAKES[sensor] if sensor else MISTAKES)[kind]
    if sensor:
        truth = with_sensor(truth, sensor, rng)
    recording = recorded(truth, rng, settings)
    scene, recording = mistake(truth, recording, rng)
    return Case(scene, recording, line)


def cell(arm: str, rng: np.random.Generator) -> Scene:
    limit = np.array([joint.torque_limit for joint in robots.load(arm).joints])
    signal = _SIGNALS[int(rng.integers(2))]
    degrees = float(rng.choice([0.0, 45.0, 90.0, 180.0])) + rng.normal(0.0, 2.0)
    base = WrenchSensor(
        rpy=(0.0, 0.0, float(np.radians(degrees))),
        translation=(0.0, 0.0, -float(rng.uniform(0.0, 0.08))),
        sign="arm_on_sensor" if rng.random() < 0.5 else "sensor_on_arm",
        bias=(*rng.normal(0.0, 15.0, 3), *rng.normal(0.0, 4.0, 3)),
    )
    torque = JointTorqueSensor(
        signal=signal,
        torque_constants=_CONSTANTS,
        friction=Friction(
            coulomb=tuple(float(x) for x in 0.03 * limit * rng.uniform(0.5, 1.5, 6)),
            viscous=tuple(float(x) for x in 0.03 * limit * rng.uniform(0.5, 1.5, 6)),
        ),
        rotor_inertia=tuple(float(x) for x in 0.005 * limit * rng.uniform(0.5, 1.5, 6)),
        noise=1.0,
    )
    roll, pitch = rng.uniform(0.1, 0.6, 2) * rng.choice([-1.0, 1.0], 2)
    tool = Tool(
        mass=float(rng.uniform(0.7, 3.0)), com=(*rng.normal(0.0, 0.02, 3)[:2], rng.uniform(0.03, 0.1))
    )
    mounting = (float(roll), float(pitch), float(rng.uniform(-3.0, 3.0)))
    return Scene(robot=arm, mounting=mounting, tool=tool, base_wrench=base, joint_torque=torque)


def recorded(
    truth: Scene, rng: np.random.Generator, settings: Settings, pushes: Sequence[Push] = ()
) -> FreeMotion:
    """Readings of an arm whose links differ from the robot's data, and on which something may push."""
    motion: Motion
    if settings.postures:
        motion = Postures(_CENTER + rng.uniform(-0.8, 0.8, (settings.postures, 6)), settings.seconds)
    else:
        motion = FourierTrajectory.draw(rng, _CENTER, np.full(6, settings.speed), 6, settings.seconds)
    inertia = {}
    for link in truth.robot.links:
        body, error = link.inertia, settings.inertia_error * rng.standard_normal(4)
        size = float(np.sqrt(np.trace(body.tensor) / (2.0 * max(body.mass, 1e-9))))
        tensor = (1.0 + error[0]) * body.tensor
        inertia[link.name] = LinkInertia(
            mass=max(body.mass * (1.0 + error[0]), 0.0),
            com=tuple(float(x) for x in body.com + size * error[1:]),
            tensor=tuple(float(tensor[i, j]) for i in range(3) for j in range(i, 3)),
        )
    real = truth.model_copy(update={"inertia": inertia})
    return simulate(real, motion, int(rng.integers(1 << 31)), settings.rate, pushes=pushes)


def _base(scene: Scene, **changes: object) -> Scene:
    assert scene.base_wrench is not None
    return scene.model_copy(update={"base_wrench": scene.base_wrench.model_copy(update=changes)})


def _tool(scene: Scene, **changes: object) -> Scene:
    assert scene.tool is not None
    return scene.model_copy(update={"tool": scene.tool.model_copy(update=changes)})


def _tilted(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    angles = np.array(scene.mounting, dtype=float)
    angles[int(rng.integers(2))] += np.radians(rng.uniform(4.0, 30.0)) * rng.choice([-1.0, 1.0])
    return scene.model_copy(update={"mounting": tuple(angles.tolist())}), recording


def _tilt_reversed(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    angles = np.array(scene.mounting, dtype=float)
    angles[int(rng.integers(2))] *= -1.0
    return scene.model_copy(update={"mounting": tuple(angles.tolist())}), recording


def _in_degrees(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    return scene.model_copy(update={"mounting": tuple(np.degrees(scene.mounting).tolist())}), recording


def _sign_reversed(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert scene.base_wrench is not None
    other = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}
    return _base(scene, sign=other[scene.base_wrench.sign]), recording


def _turned(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert scene.base_wrench is not None
    turn = Rotation.from_rotvec(np.pi / 2.0 * rng.choice([-1.0, 1.0]) * np.eye(3)[int(rng.integers(3))])
    rotation = Rotation.from_matrix(scene.base_wrench.rotation) * turn
    return _base(scene, rpy=rpy_from_rotation(rotation.as_matrix())), recording


def _swapped(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    a, b = [(0, 1), (0, 2), (1, 2)][int(rng.integers(3))]
    order = np.arange(6)
    order[[a, b, a + 3, b + 3]] = order[[b, a, b + 3, a + 3]]
    assert recording.reading is not None
    return scene, replace(recording, reading=recording.reading[:, order])


def _exchanged(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.reading is not None
    return scene, replace(recording, reading=np.roll(recording.reading, 3, axis=1))


def _displaced(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert scene.base_wrench is not None
    place = np.array(scene.base_wrench.translation) + rng.uniform(0.05, 0.2) * direction(rng)
    return _base(scene, translation=tuple(place.tolist())), recording


def _late(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    return _base(scene, delay=float(rng.uniform(0.01, 0.05) * rng.choice([-1.0, 1.0]))), recording


def _degrees(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    return scene, replace(recording, q=np.degrees(recording.q), qd=np.degrees(recording.qd))


def _torque_reversed(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    return scene, replace(recording, torque=-recording.torque)


def _other_signal(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert scene.joint_torque is not None
    assert recording.torque is not None
    # Currents multiplied by the constants where they are torques, or not multiplied where they are currents.
    currents = scene.joint_torque.signal == "actual_current"
    factor = 1.0 / np.array(_CONSTANTS) if currents else np.array(_CONSTANTS)
    signal = _SIGNALS[0] if currents else _SIGNALS[1]
    sensor = scene.joint_torque.model_copy(update={"signal": signal})
    return scene.model_copy(update={"joint_torque": sensor}), replace(
        recording, torque=recording.torque * factor
    )


def _other_mass(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert scene.tool is not None
    change = rng.uniform(0.5, 2.0)
    lighter = scene.tool.mass > change + 0.1 and rng.random() < 0.5
    return _tool(scene, mass=scene.tool.mass + (-change if lighter else change)), recording


def _other_com(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert scene.tool is not None
    com = np.array(scene.tool.com) + rng.uniform(0.05, 0.15) * direction(rng)
    return _tool(scene, com=tuple(com.tolist())), recording


def _other_arm(scene: Scene, recording: FreeMotion, _: np.random.Generator) -> tuple[Scene, FreeMotion]:
    return scene.model_copy(update={"robot": robots.load(_OTHER_ARM[scene.robot.name])}), recording


def _torque(scene: Scene, **changes: object) -> Scene:
    assert scene.joint_torque is not None
    return scene.model_copy(update={"joint_torque": scene.joint_torque.model_copy(update=changes)})


def _scaled_torques(
    scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    factor = float(rng.choice([1.3, 1.0 / 1.3, 100.0, 1.0 / 9.80665]))
    return _torque(scene, signal=_SIGNALS[0]), replace(recording, torque=factor * recording.torque)


def _other_constants(
    scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    factor = float(rng.uniform(1.25, 2.0) ** rng.choice([-1.0, 1.0]))
    constants = tuple(factor * x for x in _CONSTANTS)
    changed = _torque(scene, signal=_SIGNALS[1], torque_constants=constants)
    return changed, replace(recording, torque=factor * recording.torque)


def _frozen_torque(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    torque, joint = recording.torque.copy(), int(rng.integers(6))
    torque[:, joint] = torque[0, joint] * int(rng.integers(2))
    return scene, replace(recording, torque=torque)


def _silent_torque(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    torque = recording.torque.copy()
    torque[:, int(rng.integers(6))] = rng.normal(0.0, 1.0, len(torque))
    return scene, replace(recording, torque=torque)


def _other_unit(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.reading is not None
    factor = 1.0 / float(rng.choice([9.80665, 4.4482216]))
    moment = factor if rng.random() < 0.5 else 1.0
    return scene, replace(recording, reading=recording.reading * np.repeat([factor, moment], 3))


def _one_reversed(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.reading is not None
    signs = 1.0 - 2.0 * np.eye(6)[int(rng.integers(6))]
    return scene, replace(recording, reading=recording.reading * signs)


def _exchanged_joints(rng: np.random.Generator) -> np.ndarray:
    order, (a, b) = np.arange(6), rng.choice(6, 2, replace=False)
    order[[a, b]] = order[[b, a]]
    return order


def _positions_exchanged(
    scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    order = _exchanged_joints(rng)
    return scene, replace(recording, q=recording.q[:, order], qd=recording.qd[:, order])


def _other_zero(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    # A joint between the first and the last: those two turn the base and the tool.
    offset = np.radians(rng.uniform(5.0, 15.0)) * rng.choice([-1.0, 1.0]) * np.eye(6)[int(rng.integers(1, 5))]
    return scene, replace(recording, q=recording.q + offset)


def _loaded(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    forearm = arm_of(scene).links[scene.robot.link_names.index("forearm")].inertia
    place = forearm.com * rng.uniform(0.5, 1.5) + rng.uniform(0.0, 0.1) * direction(rng)
    return scene, with_load(scene, recording, "forearm", float(rng.uniform(1.5, 3.0)), place)


def _torques_exchanged(
    scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    return scene, replace(recording, torque=recording.torque[:, _exchanged_joints(rng)])


def _late_torques(scene: Scene, recording: FreeMotion, rng: np.random.Generator) -> tuple[Scene, FreeMotion]:
    assert recording.torque is not None
    # By whole samples: the noise stays as it is.
    count = round(float(rng.uniform(0.08, 0.12)) / float(np.median(np.diff(recording.t))))
    later = recording.part(np.arange(count, len(recording.t)))
    return scene, replace(later, torque=recording.torque[:-count])


def _other_velocities(
    scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    return scene, replace(recording, qd=float(rng.choice([0.0, 180.0 / np.pi])) * recording.qd)


MISTAKES: dict[str, tuple[Line, Mistake]] = {
    "1.5 to 3 kg more on the forearm": ("inertia.forearm", _loaded),
    "mounting tilted by 4 to 30 degrees": ("mounting", _tilted),
    "mounting: one angle with the wrong sign": ("mounting", _tilt_reversed),
    "mounting given in degrees": ("mounting", _in_degrees),
    "sign of the base wrench": ("base_wrench.sign", _sign_reversed),
    "sensor frame turned by 90 degrees": ("base_wrench.rpy", _turned),
    "two axes of the base sensor exchanged": ("base wrench: order of axes", _swapped),
    "force and moment exchanged": ("base wrench: force and moment", _exchanged),
    "base sensor displaced by 5 to 20 cm": ("base_wrench.translation", _displaced),
    "base sensor 10 to 50 ms late or early": ("base_wrench.delay", _late),
    "joint positions in degrees": ("joint positions: unit", _degrees),
    "sign of the joint torques": ("joint_torque.sign", _torque_reversed),
    "currents for torques, or the reverse": ("joint_torque.signal", _other_signal),
    "tool mass wrong by 0.5 to 2 kg": ("tool.mass", _other_mass),
    "tool's centre of mass wrong by 5 to 15 cm": ("tool.com", _other_com),
    "another arm": ("robot", _other_arm),
    "joint torques of another scale or unit": ("joint torques: scale", _scaled_torques),
    "torque constants wrong by 25 to 100 %": ("joint_torque.torque_constants", _other_constants),
    "torque of one joint zero or frozen": ("joint torques: frozen values", _frozen_torque),
    "torque of one joint replaced by noise": ("joint torques: frozen values", _silent_torque),
    "forces in kgf or lbf": ("base wrench: scale", _other_unit),
    "one component of the base sensor reversed": ("base wrench: order of axes", _one_reversed),
    "positions of two joints exchanged": ("joint positions: order", _positions_exchanged),
    "zero of one joint off by 5 to 15 degrees": ("joint positions: zero", _other_zero),
    "torques of two joints exchanged": ("joint torques: order", _torques_exchanged),
    "joint torques 80 to 120 ms late": ("joint torques: delay", _late_torques),
    "velocities zero, or in degrees": ("joint velocities: agreement", _other_velocities),
}
"""Kind of mistake -> the wrong line, and how scene and recording follow from the truth."""
