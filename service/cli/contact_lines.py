"""Contacts in a recording that was meant to be free of them, in words: for `calibrate` and `check`."""

from collections.abc import Sequence

from contactsense.calibration import SuspectedContact
from contactsense.scene import Scene

LEFT_OUT = "Left out: something seems to push on the arm"
"""The heading of `contact_lines`."""
LOOK_AT_THEM = (
    "look at the stretches that were left out: a hand, a cable, a hard stop. If nothing was there, "
    "--keep-contacts uses them"
)
"""What to do next."""
COMPONENTS = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
"""Of the readings of a force/torque sensor, in words."""


def contact_lines(contacts: Sequence[SuspectedContact], scene: Scene) -> tuple[str, ...]:
    """Where something seems to push on the arm, one line each; they were found under `scene`."""
    names, lines = channels(scene), []
    for contact in contacts:
        felt = ", ".join(
            f"{names[channel]} ({peak:.3g} {unit_of(names[channel])})"
            for channel, peak in list(zip(contact.channels, contact.peak, strict=True))[:3]
        )
        lines.append(
            f"{contact.recording}: {contact.start:.2f} to {contact.stop:.2f} s "
            f"(rows {contact.first_row} to {contact.last_row}), seen in {felt or 'all together'}"
        )
    return tuple(lines)


def channels(scene: Scene) -> tuple[str, ...]:
    """Names of all equations: joints, base sensor, sensors within the arm."""
    joints = tuple(joint.name for joint in scene.robot.joints)
    places = ("base", *scene.link_sensors)
    return joints + tuple(f"{place} {component}" for place in places for component in COMPONENTS)


def unit_of(channel: str) -> str:
    """Unit of the residual of an equation, by its name."""
    return "N" if " force " in channel else "Nm"
