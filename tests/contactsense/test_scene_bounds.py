"""Numbers of a scene that no arm has: refused where they are stated, as squares of them overflow later."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contactsense import Localizer, Sample, Scene, SceneError
from contactsense.scene_model.reading_limits import LARGEST_FORCE
from contactsense.sensors.settings import LEAST_NOISE
from tests.at_rest import weight
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
POSTURE = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
BODY = {"mass": 1.0, "com": [0.0, 0.0, 0.0], "tensor": [0.01, 0.0, 0.0, 0.01, 0.0, 0.01]}
SIX = {
    "joint_torque.rotor_inertia",
    "joint_torque.torque_constants",
    "base_wrench.bias",
    "base_wrench.range",
}
"""Fields with one number for each joint or component."""
BOUNDS = {
    "joint_torque.model_error": (0.0, 1e6),
    "joint_torque.inertia_torque_error": (0.0, 1e6),
    "joint_torque.average_error": (0.0, 1e6),
    "joint_torque.noise": (LEAST_NOISE, 1e4),
    "joint_torque.rotor_inertia": (0.0, 1e6),
    "joint_torque.torque_constants": (None, 1e4),
    "joint_torque.friction.load": (0.0, 1e6),
    "joint_torque.friction.viscous": (0.0, 1e6),
    "joint_torque.friction.error": (0.0, 1e6),
    "joint_torque.friction.velocity": (None, 100.0),
    "joint_torque.friction.lubricant_velocity": (None, 100.0),
    "joint_torque.friction.rest_velocity": (None, 100.0),
    "base_wrench.force_noise": (LEAST_NOISE, 1e4),
    "base_wrench.moment_noise": (LEAST_NOISE, 1e4),
    "base_wrench.bias": (-1e6, 1e6),
    "base_wrench.range": (None, 1e7),
    "force": (1e-3, LARGEST_FORCE),
    "bandwidth": (1e-3, 1e4),
    "bias_time": (0.1, 1e9),
    "false_alarms_per_hour": (None, 1e6),
}
"""Field -> its smallest and its largest number; without a smallest one it must be above 0."""


def _with(field: str, number: float) -> dict[str, Any]:
    """Fields of a scene, with a number, or six, in one of them."""
    *parts, last = field.split(".")
    fields: dict[str, Any] = {"robot": ARM}
    part = fields
    for name in parts:
        part = part.setdefault(name, {})
    part[last] = [number] * 6 if field in SIX else number
    return fields


@pytest.mark.parametrize("field", BOUNDS)
def test_a_number_that_no_arm_has_is_refused(field: str) -> None:
    least, most = BOUNDS[field]
    place = field + ("[0]" if field in SIX else "")
    for number in (1e300, np.nextafter(most, np.inf)):
        with pytest.raises(
            SceneError, match=rf"^{re.escape(place)}.*: expected .* at most {most:.10g}.*, got"
        ):
            Scene(**_with(field, number))
    if least is not None:
        words = f"at least {least:.10g}".replace("+", r"\+")
        with pytest.raises(SceneError, match=rf"^{re.escape(place)}.*: expected .*{words}.*, got"):
            Scene(**_with(field, np.nextafter(least, -np.inf)))


def _tool(**primitive: object) -> dict[str, Any]:
    return {"tool": {"primitives": [primitive]}}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"tool": {"mass": 1e300}}, r"tool\.mass: expected a number of at most 1000000, got"),
        (
            {"tool": {"tensor": [1e300] * 6}},
            r"tool\.tensor\[0\]: expected a number of at most 1000000000, got",
        ),
        (
            {"inertia": {"forearm": BODY | {"mass": 1e300}}},
            r"inertia\.forearm\.mass: .* at most 1000000, got",
        ),
        (
            {"inertia": {"forearm": BODY | {"tensor": [0.01, -1e300, 0.0, 0.01, 0.0, 0.01]}}},
            r"inertia\.forearm\.tensor\[1\]: expected a number of at least -1000000000, got",
        ),
        ({"link_prior": dict.fromkeys(ARM.link_names, 1e308)}, r"link_prior\.base: .* at most 1000000000"),
        (_tool(kind="sphere", center=[0, 0, 0.1], radius=1e-300), "radius: expected .* at least 1e-09, got"),
        (
            _tool(kind="ellipsoid", center=[0, 0, 0], radii=[0.1, 0.1, 1e-300]),
            r"radii\[2\]: expected a number of at least 1e-09, got 1e-300",
        ),
        (
            _tool(kind="capsule", a=[0, 0, 0], b=[0, 0, 1e-300], radius=0.1),
            "a and b are the same point; use kind: sphere",
        ),
    ],
)
def test_an_inertia_a_weight_or_a_shape_that_is_none_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        Scene(**{"robot": ARM, **fields})


def test_an_empty_path_names_no_folder_of_meshes(tmp_path: Path) -> None:
    told = r"meshes: expected a path, or null for none, got ''$"
    with pytest.raises(SceneError, match=f"^{told}"):
        Scene(robot=ARM, detail="skin", meshes="")
    file = tmp_path / "scene.yaml"
    file.write_text("robot: ur5e\ndetail: skin\nmeshes: ''\n")
    with pytest.raises(SceneError, match=told):
        Scene.load(file)


@pytest.mark.parametrize("largest", [False, True])
def test_estimates_of_a_scene_at_its_bounds_are_finite(largest: bool) -> None:
    """Of one measurement, and of a moving arm."""
    torque, wrench = weight(Scene(robot=ARM), POSTURE)
    for field, bounds in BOUNDS.items():
        number = bounds[largest]
        if number is None:
            continue
        localizer = Localizer(Scene(**_with(field, number)))
        found = localizer.locate(
            POSTURE, base_wrench=wrench + 30.0, joint_torque=torque + 5.0, external=False, detect=False
        )
        numbers = [found.link_probability, found.wrench, found.covariance, found.other]
        assert all(np.isfinite(part).all() for part in numbers), (field, number)
        steps = [
            localizer.step(
                Sample(0.002 * i, POSTURE + 0.3e-3 * i, np.full(6, 0.15), torque, wrench + 0.1 * i)
            )
            for i in range(60)
        ]
        assert all(np.isfinite(step.covariance).all() for step in steps), (field, number)
