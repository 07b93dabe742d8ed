"""Signals that no hypothesis explains."""

import numpy as np

from contactsense.robots.torque_scale import torque_scales
from contactsense.scene import Scene
from contactsense.setup_check.fit.fitter import Fit, Fitter
from contactsense.setup_check.lines import label, wrench_fields
from contactsense.setup_check.terms.motion_basis import Readings

NOT_EXPLAINED = "not explained by any line of the scene (a contact, another signal, a fault?)"
"""What is said of `unexplained_signals`."""
_NOISE_FACTOR, _SHARE = 7.5, 0.3
"""A signal is unexplained if its residual exceeds its noise by this factor, this share of its own variation,
and `UNEXPLAINED_SHARE`."""
UNEXPLAINED_SHARE = 0.03
"""Share of the joints' largest torques, or of the weight of what a sensor carries."""
ARM_LEVER, _TOOL_LEVER = 0.5, 0.1
"""Moments are compared with that weight at these levers [m]."""


def unexplained_signals(scene: Scene, fitter: Fitter, readings: Readings, now: Fit) -> tuple[str, ...]:
    """Signals whose residual is large by every measure: their noise, their variation, and the arm. In Nm and
    N, also where they are read in other units."""
    n, fields = len(scene.robot.joints), wrench_fields(scene)
    per_unit = now.setup.per_unit(fields)
    rms = now.rms / per_unit
    scale = [torque_scales(scene.robot)]
    variation = np.full(len(rms), np.inf)
    if readings.torque is not None:
        variation[:n] = np.nanstd(readings.torque, axis=0)
    names = [f"torque of {joint.name}" for joint in scene.robot.joints]
    for i, field in enumerate(fields):
        weight = scene.gravity * float(now.setup.carried(field)[:, 0].sum())
        lever = _TOOL_LEVER if now.setup.sensors[field].tool_alone else ARM_LEVER
        scale.append(np.repeat([weight, weight * lever], 3))
        if field in readings.wrenches:
            variation[n + 6 * i :][:6] = np.nanstd(readings.wrenches[field], axis=0)
        names += [f"{label(field)} sensor's {what} {axis}" for what in ("force", "moment") for axis in "xyz"]
    large = (rms > _NOISE_FACTOR * fitter.noise) & (rms > _SHARE * variation / per_unit)
    large &= rms > UNEXPLAINED_SHARE * np.concatenate(scale)
    units = ["Nm"] * n + (["N"] * 3 + ["Nm"] * 3) * len(fields)
    return tuple(f"{names[c]}: residual {rms[c]:.3g} {units[c]}" for c in np.flatnonzero(large))
