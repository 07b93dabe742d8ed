"""The result of a calibration as a page: what was left out, what changed, what it means, what to do next."""

from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from contactsense.calibration import Calibration, Value
from contactsense.calibration.fit.gauss_newton import NOT_ESTIMATED
from contactsense.calibration.parameters import OPTIONAL_FRICTION
from contactsense.calibration.result import CHANGED
from contactsense.scene import Scene
from contactsense.service.cli.contact_lines import (
    COMPONENTS,
    LEFT_OUT,
    LOOK_AT_THEM,
    channels,
    contact_lines,
    unit_of,
)
from contactsense.setup_check.findings.unexplained import ARM_LEVER, UNEXPLAINED_SHARE

_TITLES = {
    "bias": "torque bias",
    "coulomb": "Coulomb friction",
    "viscous": "viscous friction",
    "rotor": "rotor inertia",
    "load": "load-dependent friction",
    "lubricant": "lubricant friction",
    "gain": "torque constants, factor",
    "wrench_bias": "bias of the base sensor",
    "tilt": "direction of gravity",
    "turn": "orientation of the base sensor",
    "shift": "place of the base sensor",
    "link_bias": "bias of",
    "link_turn": "orientation of",
    "link_shift": "place of",
}
"""Groups of parameters that are printed in one line, with the field of a sensor within the arm behind it; the
other parameters have a line each."""
_PLACES = {"turn": "rpy", "link_turn": "rpy", "shift": "translation", "link_shift": "translation"}
"""Fields of a sensor to which a group is a correction."""
_WRONG = 2.0
"""A fit whose residual of any equation is this many times that of the scene has gone wrong."""


@dataclass(frozen=True)
class Section:
    """A heading and its lines."""

    title: str
    lines: tuple[str, ...]


def page(
    found: Calibration, scene: Scene, written: Path | None, against: tuple[str, ...]
) -> tuple[Section, ...]:
    """The sections of the page.

    Args:
        found: Result of the calibration.
        scene: The scene before.
        written: File into which the calibrated scene was written.
        against: Why it should not be used, see `reasons_against`.
    """
    names = channels(scene)
    sections = [
        Section(LEFT_OUT, contact_lines(found.contacts, scene)),
        Section("What changed", _changes(found, scene)),
        Section("What it means", _meaning(found, names)),
        Section("What to do next", _next_steps(found, written, against)),
    ]
    return tuple(section for section in sections if section.lines)


def _changes(found: Calibration, scene: Scene) -> tuple[str, ...]:
    lines, same = [], []
    joints = [joint.name for joint in scene.robot.joints]
    for (group, sensor, _), members in groupby(found.values, key=_line):
        block = [value for value in members if not value.kept]
        if not block or group == "payload":
            continue
        title = block[0].entry.name
        if group in _TITLES:
            title = _TITLES[group] if sensor is None else f"{_TITLES[group]} {sensor}"
        if any(value.changed for value in block):
            lines.append(f"{title}: {_field(group, sensor, found.scene, scene) or _values(block, joints)}")
        elif title not in same:
            same.append(title)
    if _tool(found.scene) != _tool(scene):
        lines.append(f"tool: {_tool(found.scene)} (was {_tool(scene)})")
    elif found.scene.tool != scene.tool:
        lines.append(f"tool: {_tool(scene)}, as before")
    if found.inertia:
        lines.append(f"inertia of the links: {len(found.inertia)} parameters, listed by --verbose")
    if found.constrained:
        rise = np.nanmax(found.after.rms / found.unconstrained.rms) - 1.0
        lines.append(
            f"constrained to the inertia that bodies have: {', '.join(found.constrained)}. The RMS of a "
            f"residual rises by up to {100.0 * rise:.1f} %"
        )
    lines += _left_out_terms(found, joints)
    if same:
        lines.append(f"confirmed within {CHANGED:g} standard deviations: {', '.join(same)}")
    return tuple(lines)


def _left_out_terms(found: Calibration, joints: list[str]) -> list[str]:
    """The optional terms of friction that are not estimated, and why: one line for each term and reason."""
    of_reason: dict[tuple[str, str], list[str]] = {}
    for value in found.values:
        if value.kept and value.entry.group in OPTIONAL_FRICTION and value.entry.joint is not None:
            # Estimates that came out negative differ from joint to joint.
            reason = value.kept.partition(NOT_ESTIMATED[0])[0].partition(" (")[0]
            of_reason.setdefault((value.entry.group, reason), []).append(joints[value.entry.joint])
    return [
        f"{_TITLES[group]} is not estimated, but kept as in the scene: {reason} "
        f"({'all joints' if len(names) == len(joints) else ', '.join(names)})"
        for (group, reason), names in of_reason.items()
    ]


def _line(value: Value) -> tuple[str, str | None, str]:
    """What parameters that are printed in one line have in common."""
    return value.entry.group, value.entry.sensor, value.entry.unit


def _tool(scene: Scene) -> str:
    if scene.tool is None:
        return "none"
    # As whole numbers, of which none is "-0".
    x, y, z = (round(1e3 * part) for part in scene.tool.com)
    return f"{scene.tool.mass:.3g} kg, centre of mass {x}, {y}, {z} mm from the flange"


def _field(group: str, sensor: str | None, after: Scene, before: Scene) -> str:
    """The scene's field after and before, where the parameters are corrections to it; empty elsewhere."""
    if group == "tilt":
        # The angles hide a small tilt where the pitch is about 90 degrees, as on a wall.
        tilt = np.degrees((before.orientation.inv() * after.orientation).magnitude())
        mounting = f"{_triple(after.mounting)} (was {_triple(before.mounting)})"
        return f"mounting {mounting}, tilted by {tilt:.2g} degrees"
    if group not in _PLACES:
        return ""
    new, old = (
        getattr(scene.base_wrench if sensor is None else scene.link_sensors[sensor], _PLACES[group])
        for scene in (after, before)
    )
    return f"{_PLACES[group]} {_triple(new)} (was {_triple(old)})"


def _triple(value: str | tuple[float, ...]) -> str:
    """Three numbers to a tenth of a millimetre or milliradian, or a word."""
    return (
        value if isinstance(value, str) else f"[{', '.join(f'{round(part, 4) + 0.0:g}' for part in value)}]"
    )


def _values(block: list[Value], joints: list[str]) -> str:
    """Values after and before; one number where all are alike. Of some joints only, with their names."""
    some = len(block) < len(joints)
    after = ", ".join(
        f"{joints[value.entry.joint]} {value.after:.3g}"
        if some and value.entry.joint is not None
        else f"{value.after:.3g}"
        for value in block
    )
    before = [f"{value.before:.3g}" for value in block]
    was = before[0] if len(set(before)) == 1 else ", ".join(before)
    unit = f" {block[0].entry.unit}" if block[0].entry.unit else ""
    return f"{after}{unit} (was {was})"


def _meaning(found: Calibration, names: tuple[str, ...]) -> tuple[str, ...]:
    lines = [
        f"{names[i]}: {found.before.rms[i]:.3g} -> {found.after.rms[i]:.3g} {unit_of(names[i])} "
        f"({found.after.tail[i]:.3g})"
        for i in np.flatnonzero(np.isfinite(found.after.rms))
    ]
    lines.insert(
        0,
        "a contact is detected where it exceeds what the model leaves unexplained: RMS before -> after "
        "(99.9 % of the time less than)",
    )
    worse = [
        names[i]
        for i in np.flatnonzero(np.isfinite(found.after.rms))
        if found.after.rms[i] > found.before.rms[i] * 1.05
    ]
    if worse:
        lines.append(f"worse than before: {', '.join(worse)}")
    return tuple(lines)


def _unexplained(found: Calibration, names: tuple[str, ...]) -> list[str]:
    """Components of the base sensor that no values of the parameters explain, by the limits of `contactsense
    check`."""
    scene = found.scene
    weight = scene.gravity * (scene.robot.mass + scene.tool_inertia.mass)
    limit = UNEXPLAINED_SHARE * weight
    limits = {f"base {name}": limit * (ARM_LEVER if "moment" in name else 1.0) for name in COMPONENTS}
    return [
        f"{name} ({rms:.3g} {unit_of(name)})"
        for name, rms in zip(names, found.after.rms, strict=True)
        if rms > limits.get(name, np.inf)
    ]


def reasons_against(found: Calibration, doubts: tuple[str, ...]) -> tuple[str, ...]:
    """Why the calibrated scene should not be used, one sentence each; none: it can be.

    `doubts`: see `contactsense.service.cli.calibration_doubts`.
    """
    names = channels(found.scene)
    reasons = [
        f"do not use this scene: {text}. Run `contactsense check` on the scene before, correct what "
        "it names, and calibrate again"
        for text in doubts
    ]
    known = np.isfinite(found.after.rms)
    if (found.after.rms[known] > _WRONG * found.before.rms[known]).any():
        reasons.append(
            "do not use this scene: the one before explains this motion better. Record more motion, such as "
            "that of `contactsense excite`, or find the wrong line with `contactsense check`"
        )
    elif unexplained := _unexplained(found, names):
        # A fit cannot reverse a sign or exchange axes: it bends what it may change.
        reasons.append(
            f"do not use this scene: it does not explain {', '.join(unexplained)}. Find the wrong line of "
            "the scene before with `contactsense check`"
        )
    return tuple(reasons)


def _next_steps(found: Calibration, written: Path | None, against: tuple[str, ...]) -> tuple[str, ...]:
    steps = [*against, *(warning for warning in found.warnings if not warning.endswith(NOT_ESTIMATED))]
    if found.contacts:
        steps.append(LOOK_AT_THEM)
    # Beside a wrong line even the best motion does not excite, and `excite` does not seek load and lubricant.
    sought = [v for v in found.values if v.entry.group not in OPTIONAL_FRICTION]
    unexcited = sorted({v.entry.name for v in sought if v.kept.startswith("not excited")})
    if unexcited and not against:
        more = f" and {len(unexcited) - 3} more" if len(unexcited) > 3 else ""
        steps.append(
            f"this motion does not excite {', '.join(unexcited[:3])}{more}, kept as in the scene: a "
            "motion of `contactsense excite` does"
        )
    if against and written is None:
        steps.append("no scene was changed")
    elif written is None:
        steps.append("nothing was written: --out FILE writes the calibrated scene, --write changes the scene")
    elif not against:
        steps.append(
            f"try {written} on a recording that calibration has not seen, without contacts: "
            f"`contactsense analyze RECORDING --scene {written} --out FOLDER` must find none"
        )
    return tuple(steps)
