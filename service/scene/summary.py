"""What a scene says, in words: for `contactsense scene show` and for the service's start."""

from collections.abc import Iterator, Sequence
from math import acos, degrees
from typing import Any, NamedTuple

import numpy as np

from contactsense.localization.surface.surface_samples import sample_surface
from contactsense.plausibility.largest_reading import (
    RAMP_TIME,
    joints_of_unknown_speed,
    largest_reading_at_rest,
    largest_reading_in_motion,
)
from contactsense.robots.link_poses import link_poses
from contactsense.robots.primitives import Primitive
from contactsense.robots.surface.primitive_extent import beyond, extent
from contactsense.robots.units import FURTHEST
from contactsense.scene import Scene
from contactsense.scene_model.arm_weight import ArmWeight
from contactsense.scene_model.link_prior import area_share, link_probability
from contactsense.scene_model.scene_surfaces import scene_surfaces, touchable_links
from contactsense.scene_model.wrench_map import WrenchMap
from contactsense.sensors.settings import (
    COMPONENTS,
    JointTorqueSensor,
    LinkWrenchSensor,
    Meaning,
    WrenchSensor,
)
from contactsense.service.scene.link_reading_at_rest import link_reading_at_rest
from contactsense.service.scene.load_warnings import load_warnings, weightless_tool

_MEANINGS: dict[Meaning, str] = {
    "motor": "the motors' torque: gravity, inertia, rotors and friction are in it",
    "gravity_free": "the motors' torque without gravity: inertia, rotors and friction are in it",
    "external": "the torque of contacts alone",
}
"""What the value of `joint_torque.meaning` says."""


class Line(NamedTuple):
    """One thing that was understood."""

    subject: str
    text: str


def summarize(scene: Scene, q: np.ndarray) -> tuple[Line, ...]:
    """What was understood of a scene, in the order of its fields.

    Args:
        scene: The scene.
        q: Posture for which readings at rest are given, shape (n,) [rad].
    """
    robot, weight = scene.robot, ArmWeight(scene)
    lines = [
        Line("robot", f"{robot.name}, {len(robot.joints)} joints, {robot.mass:.2f} kg without tool"),
        Line("mounting", _mounting(scene)),
        Line("tool", _tool(scene)),
        Line("bodies", _bodies(scene)),
        *_base_sensor(scene, weight, q),
        Line("joint_torque", _torque(scene)),
        *_link_sensors(scene, q),
        Line("touchable", _touchable(scene)),
        Line("surface", surface_in_words(scene)),
        Line(
            "contacts",
            f"up to {scene.contacts} at a time; {scene.false_alarms_per_hour:g} false alarms per hour",
        ),
    ]
    return tuple(lines)


def surface_in_words(scene: Scene) -> str:
    """The level of detail, and how far the surface of the scene is from the skin of the links."""
    coarse = scene.detail == "coarse"
    cells = [link.coarse_deviation if coarse else link.deviation for link in scene.robot.links]
    if scene.surface_error is None and any(cells):
        name = "coarse_deviation" if coarse else "fine_deviation"
        return f"detail {scene.detail}, as far from the skin as {name} of the surface file says"
    return f"detail {scene.detail}, within {1e3 * scene.surface_deviation:g} mm (one sigma)"


def as_plain(scene: Scene, q: np.ndarray) -> dict[str, Any]:
    """What was understood as plain data, for a program; SI units, base axes unless stated otherwise."""
    weight = ArmWeight(scene)
    sensor = scene.base_wrench
    moving = None if sensor is None else largest_reading_in_motion(scene, "base_wrench")
    return {
        "scene": scene.model_dump(mode="json"),
        "links": list(scene.link_names),
        "mass": weight.mass,
        "gravity_base": scene.gravity_base.tolist(),
        "q": q.tolist(),
        "base_reading_at_rest": (
            None if sensor is None else WrenchMap.of(sensor).reading(weight.wrench(q)).tolist()
        ),
        "link_readings_at_rest": {
            field: link_reading_at_rest(scene, field, q).tolist() for field in scene.link_sensors
        },
        "largest_base_reading_at_rest": None
        if sensor is None
        else largest_reading_at_rest(scene, "base_wrench").tolist(),
        "largest_base_reading_in_motion": None if moving is None else moving.tolist(),
        "warnings": list(scene_warnings(scene)),
    }


def scene_warnings(scene: Scene) -> tuple[str, ...]:
    """What is possible but cannot work well, one line each, with the field to change."""
    found = [
        *_mass_warnings(scene),
        *weightless_tool(scene),
        *load_warnings(scene),
        *_range_warnings(scene, "base_wrench", scene.base_wrench, "arm"),
    ]
    for field, sensor in scene.link_sensors.items():
        found += _range_warnings(scene, field, sensor, "tool" if field == "wrist_wrench" else "load")
    if scene.tool is not None and scene.tool.mass > 0.0 and not scene.tool.primitives:
        found.append("tool.primitives: the tool has no surface; contacts on it cannot be found")
    bare = [link.name for link in scene.robot.links if not link.primitives]
    if names := [name for name in scene.touchable_links if name in bare]:
        found.append(f"robot: {', '.join(names)}: no surface; contacts on it cannot be found")
    for i, body in enumerate(scene.bodies):  # a floor may be as large
        found += [f"bodies[{i}].primitives[{j}]: {text}" for j, text in beyond(body.primitives, FURTHEST)]
    return tuple(found)


def _mass_warnings(scene: Scene) -> Iterator[str]:
    """Moving links whose weight a sensor measures and the model does not know."""
    external = scene.joint_torque is None or scene.joint_torque.contains == "external"
    if external and scene.base_wrench is None and not scene.link_sensors:
        return
    links = zip(scene.robot.link_names[1:], scene.link_inertia[1:], strict=True)
    light = [name for name, inertia in links if inertia.mass == 0.0]
    if light:
        yield (
            f"robot: expected the mass of each moving link, got 0 kg for {', '.join(light)}; what they weigh "
            "looks like a contact"
        )


def _range_warnings(scene: Scene, field: str, sensor: WrenchSensor | None, carried: str) -> Iterator[str]:
    """Components of a sensor whose range the weight of what it carries reaches, or its weight and motion."""
    if sensor is None or sensor.range is None:
        return
    at_rest = largest_reading_at_rest(scene, field)
    moving = largest_reading_in_motion(scene, field)
    if moving is None:
        moving = np.zeros(6)
    units = ("N",) * 3 + ("Nm",) * 3
    for name, rest, motion, limit, unit in zip(
        COMPONENTS, at_rest, moving, sensor.limits, units, strict=True
    ):
        if max(rest, motion) >= limit:
            load, cause = (rest, "weight reaches")
            if rest < limit:
                load, cause = motion, f"weight and motion reach (full speed within {RAMP_TIME:g} s)"
            yield (
                f"{field}.range: expected more than {load:.3g} {unit} in {name}, which the {carried}'s own "
                f"{cause}, got {limit:g} {unit}; beyond it, the sensor is not used"
            )


def _mounting(scene: Scene) -> str:
    up = scene.orientation.apply([0.0, 0.0, 1.0])
    tilt = degrees(acos(float(np.clip(up[2], -1.0, 1.0))))
    name = f"{scene.mounting}: " if isinstance(scene.mounting, str) else ""
    return f"{name}base z axis {tilt:.1f} deg from the vertical; gravity in base axes " + _vector(
        scene.gravity_base, "m/s^2"
    )


def _tool(scene: Scene) -> str:
    tool = scene.tool
    if tool is None:
        return "none"
    surface = _shape(tool.primitives) if tool.primitives else "no surface"
    if tool.deviation and scene.surface_error is None:
        surface += ", as far from the skin as deviation says"
    return f"{tool.name}, {tool.mass:g} kg at {_vector(tool.com, 'm')} of the flange, {surface}"


def _bodies(scene: Scene) -> str:
    return (
        "; ".join(f"{body.name} ({body.role}), {_shape(body.primitives)}" for body in scene.bodies) or "none"
    )


def _shape(primitives: Sequence[Primitive]) -> str:
    """Number of primitives and their size together."""
    size = " x ".join(f"{round(length, 3):g}" for length in extent(primitives))
    count = len(primitives)
    return f"{count} primitive{'' if count == 1 else 's'}, {size} m along its axes"


def _base_sensor(scene: Scene, weight: ArmWeight, q: np.ndarray) -> tuple[Line, ...]:
    sensor = scene.base_wrench
    if sensor is None:
        return (Line("base_wrench", "none"),)
    reading = WrenchMap.of(sensor).reading(weight.wrench(q))
    largest = largest_reading_at_rest(scene, "base_wrench")
    limits = "range unknown"
    if sensor.range is not None:
        limits = f"at most {100.0 * (largest / sensor.limits).max():.0f} % of its range"
    return (
        Line("base_wrench", _sensor(sensor, "base")),
        Line("", _at_rest(reading, q)),
        Line(
            "",
            f"at rest up to {largest[:3].max():.0f} N, {largest[3:].max():.0f} Nm on one axis, in any "
            f"posture: {limits}",
        ),
        Line("", _in_motion(scene, "base_wrench")),
    )


def _in_motion(scene: Scene, field: str) -> str:
    """What the range of a sensor must exceed."""
    largest = largest_reading_in_motion(scene, field)
    if largest is None:
        names = ", ".join(joints_of_unknown_speed(scene.robot))
        return f"in motion not known: the arm's description has no largest speed of {names}"
    force, moment = np.round((largest[:3].max(), largest[3:].max()), 6)  # rounding errors are no moment
    return (
        f"in motion up to {force:.3g} N, {moment:.3g} Nm on one axis (every joint at "
        f"full speed, reached or left within {RAMP_TIME:g} s); contacts come on top"
    )


def _at_rest(reading: np.ndarray, q: np.ndarray) -> str:
    posture = ", ".join(f"{angle:.0f}" for angle in np.degrees(q))
    return f"must read {_wrench(reading)} at rest with joints at ({posture}) deg"


def _link_sensors(scene: Scene, q: np.ndarray) -> Iterator[Line]:
    for field, sensor in scene.link_sensors.items():
        yield Line(field, _sensor(sensor, sensor.link if isinstance(sensor, LinkWrenchSensor) else "flange"))
        yield Line("", _at_rest(link_reading_at_rest(scene, field, q), q))
        yield Line("", _in_motion(scene, field))
    if scene.wrist_wrench is None:
        yield Line("wrist_wrench", "none")


def _sensor(sensor: WrenchSensor, frame: str) -> str:
    axes = ", ".join(
        f"{name} along {_direction(sensor.rotation[:, i])}" for i, name in enumerate(("x", "y", "z"))
    )
    return (
        f"at {_vector(sensor.translation, 'm')} of the {frame} frame; its axes in {frame} axes: {axes}; "
        f"sign {sensor.sign}; noise {sensor.force_noise:g} N, {sensor.moment_noise:g} Nm"
    )


def _torque(scene: Scene) -> str:
    sensor = scene.joint_torque
    if sensor is None:
        return "none"
    return f"{sensor.signal}, {_MEANINGS[sensor.contains]}; sign {sensor.sign}; " + "; ".join(
        torque_errors_in_words(sensor)
    )


def torque_errors_in_words(sensor: JointTorqueSensor) -> list[str]:
    """Noise of the joint torques, and the errors of their model that the scene states."""
    stated = {
        "noise": sensor.noise,
        "model error": sensor.model_error,
        "friction error at rest": sensor.friction.rest_error,
    }
    numbers = {name: value if isinstance(value, tuple) else (value,) for name, value in stated.items()}
    return [
        f"{name} {', '.join(f'{x:g}' for x in values)} Nm"
        for name, values in numbers.items()
        if name == "noise" or any(values)
    ]


def _touchable(scene: Scene) -> str:
    names = list(scene.touchable_links)
    others = [name for name in scene.link_names if name not in names]
    if touchable_links(scene)[0] and others[:1] == [scene.link_names[0]]:
        # The part of the base link that pedestals are, which `link_prior` names with it.
        names += [body.name for body in scene.bodies if body.role == "pedestal"]
    return ", ".join(names) + (f"; not: {', '.join(others)}" if others else "")


def prior_of_links(scene: Scene) -> dict[str, float]:
    """Prior probability of a contact on each link that can be touched."""
    surfaces = scene_surfaces(scene)
    share = np.sign(np.diff(surfaces.start)).astype(float)
    if scene.link_prior == "area":
        # Measuring the surface takes a second; the other priors need to know only where there is one.
        samples, _, _ = sample_surface(surfaces)
        share = area_share(surfaces, samples, len(scene.link_names))
    probability = link_probability(scene, share)
    return {name: float(p) for name, p in zip(scene.link_names, probability, strict=True) if p > 0.0}


def link_prior_line(scene: Scene) -> Line:
    """What `link_prior` means for each link."""
    kind = scene.link_prior if isinstance(scene.link_prior, str) else "weights"
    parts = ", ".join(f"{name} {100.0 * p:.3g} %" for name, p in prior_of_links(scene).items())
    return Line("link_prior", f"{kind}: {parts}")


def _direction(axis: np.ndarray) -> str:
    """An axis by its name where it is one, else by its components."""
    index = int(np.abs(axis).argmax())
    if abs(axis[index]) > 1.0 - 1e-6:
        return f"{'-' if axis[index] < 0.0 else '+'}{'xyz'[index]}"
    return _vector(axis, "")


def _vector(values: Sequence[float] | np.ndarray, unit: str) -> str:
    numbers = ", ".join(f"{value + 0.0:.4g}" for value in np.round(np.asarray(values, dtype=float), 4))
    return f"({numbers}) {unit}".rstrip()


def _wrench(wrench: np.ndarray) -> str:
    numbers = [f"{value:.1f}" for value in np.round(wrench, 1) + 0.0]
    return f"force ({', '.join(numbers[:3])}) N, moment ({', '.join(numbers[3:])}) Nm"


def link_places(scene: Scene, q: np.ndarray) -> np.ndarray:
    """Poses of all `scene.link_names` in the base frame, the tool's being the flange, (links, 4, 4)."""
    poses = link_poses(scene.robot, q)
    if len(scene.link_names) == len(poses):
        return poses
    flange = np.eye(4)
    flange[:3, :3], flange[:3, 3] = scene.robot.flange_rotation, scene.robot.flange_translation
    return np.concatenate((poses, (poses[-1] @ flange)[None]))
