"""Sensor readings caused by a contact: the forward model that the localizer inverts, for an arm at rest."""

from math import isfinite
from numbers import Real
from typing import NamedTuple

import numpy as np

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.attribute_docs import with_attributes
from contactsense.robots.units import in_metres
from contactsense.scene import Scene, check_scene
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.scene_model.link_sensors import mounts
from contactsense.scene_model.load_weight import LoadWeight
from contactsense.sensors.validation import checked_flag, checked_vector

_ROUNDING = 1e-3
"""Of the squared length of a unit vector whose components were rounded."""


@with_attributes
class Readings(NamedTuple):
    """The sensors' readings without noise, see `contactsense.types.Sample`."""

    joint_torque: np.ndarray
    """Torque that each actuator applies [Nm], shape (n,)."""
    base_wrench: np.ndarray
    """Wrench of the arm on the base sensor, base axes, base origin [N, Nm], shape (6,)."""
    wrist_wrench: np.ndarray | None
    """Wrench on the wrist sensor of what it carries, base axes, base origin [N, Nm], shape (6,); None: the
    scene has none."""
    link_wrenches: dict[str, np.ndarray]
    """The same of each of `Scene.link_wrenches`, by its name."""


def forward_model(
    scene: Scene,
    q: np.ndarray,
    link: str,
    point: np.ndarray,
    force: np.ndarray,
    torsion: float = 0.0,
    normal: np.ndarray | None = None,
    *,
    external: bool = False,
) -> Readings:
    """Readings of the sensors when an arm at rest is touched.

    A contact wrench w on link k adds w to the base wrench and -s_j . w to the torque of every joint j below
    that link (Haddadin, De Luca & Albu-Schaeffer, T-RO 2017), and w to the sensors within the arm that carry
    the link.

    Args:
        scene: The arm, its mounting and its sensors.
        q: Joint positions [rad], shape (n,).
        link: Name of the touched link.
        point: Contact point, link frame [m], shape (3,); it need not be on the surface.
        force: Force on the robot, base axes [N], shape (3,).
        torsion: Moment on the robot about `normal` [Nm].
        normal: Outward unit normal, base axes, shape (3,); needed with `torsion` only.
        external: Whether to omit the arm's own weight, as `Localizer.locate` expects by default.

    Raises:
        ValueError: the link is unknown, an argument has the wrong shape, positions are beyond the joints'
            limits and one turn or the point is more than 5 m from its frame, as with other units, or `normal`
            is missing or no unit vector.
        TypeError: `scene` is none.
    """
    check_scene(scene)
    external = checked_flag("external", external)
    robot, joints = scene.robot, len(scene.robot.joints)
    if link not in scene.link_names:
        raise ValueError(f"link: expected one of {', '.join(scene.link_names)}, got {link!r}")
    q = checked_vector("q", q, joints, "rad")
    point, force = checked_vector("point", point, 3, "m"), checked_vector("force", force, 3, "N")
    if (beyond := PlausibleLimits(scene).position(q)) is not None:
        raise ValueError(f"q: {beyond.reason}")
    try:
        in_metres(tuple(point.tolist()))
    except ValueError as error:
        raise ValueError(f"point: {error}") from None
    torsion_moment = _checked_torsion(torsion, normal)
    index = scene.link_names.index(link)
    body = min(index, joints)
    model, motion = build_model(robot), empty_motion(joints)
    forward_kinematics(model, q, motion)
    if index > joints:
        point = robot.flange_translation + robot.flange_rotation @ point
    place = motion.origin[body] + motion.rotation[body] @ point
    wrench = np.concatenate((force, np.cross(place, force) + torsion_moment))
    torque, base = np.zeros(joints), np.zeros(6)
    felt = np.where(np.arange(joints) < body, -motion.screw @ wrench, 0.0)
    if not external:
        still = np.zeros(joints)
        weight = model_with_tool(scene)
        inverse_dynamics(weight, q, still, still, scene.gravity_base, motion, torque, base)
    links = {}
    for field, mount in mounts(scene).items():
        links[field] = wrench if index >= mount.first_link else np.zeros(6)
        if not external:
            links[field] = links[field] + LoadWeight(scene, field).wrench(q)
    wrist = links.pop("wrist_wrench", None)
    named = {field.removeprefix("link_wrenches."): reading for field, reading in links.items()}
    return Readings(torque + felt, base + wrench, wrist, named)


def _checked_torsion(torsion: float, normal: np.ndarray | None) -> np.ndarray:
    """Moment of a torsion about a normal, shape (3,) [Nm]; raises as `forward_model` does."""
    if not (isinstance(torsion, Real) and isfinite(torsion)):
        raise ValueError(f"torsion: expected a finite number, got {torsion!r}")
    if normal is None:
        if torsion != 0.0:
            raise ValueError("normal: expected the outward normal that torsion acts about, got none")
        return np.zeros(3)
    normal = checked_vector("normal", normal, 3, "1")
    if abs(float(normal @ normal) - 1.0) > _ROUNDING:
        raise ValueError(f"normal: expected a unit vector, got {normal.tolist()}")
    return torsion * normal
