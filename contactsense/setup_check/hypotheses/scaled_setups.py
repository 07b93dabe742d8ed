"""A setup whose signals are in other units: where the search for a scale starts."""

from dataclasses import replace

from contactsense.sensors.force_units import (
    KILOGRAM_FORCE,
    POUND_FORCE,
    POUND_FORCE_FOOT,
    POUND_FORCE_INCH,
)
from contactsense.setup_check.setup import SCALED, Setup

Starts = tuple[tuple[str, Setup], ...]
"""As `Hypothesis.starts`."""

TORQUE_UNITS = {
    "Ncm": 100.0,
    "mNm": 1000.0,
    "kgf m": 1.0 / KILOGRAM_FORCE,
    "kgf cm": 100.0 / KILOGRAM_FORCE,
    "lbf ft": 1.0 / POUND_FORCE_FOOT,
    "lbf in": 1.0 / POUND_FORCE_INCH,
}
"""Values per newton metre."""
FORCE_UNITS = {"kgf": 1.0 / KILOGRAM_FORCE, "lbf": 1.0 / POUND_FORCE, "mN": 1000.0}
"""Values per newton."""
MOMENT_UNITS = {"Nmm" if unit == "mNm" else unit: value for unit, value in TORQUE_UNITS.items()}
"""Values per newton metre; moments in mNm are those in Nmm, as force/torque sensors call it."""
_FORCES, _MOMENTS = (1.0, *FORCE_UNITS.values()), (1.0, *MOMENT_UNITS.values())


def torques_in_units(setup: Setup) -> Starts:
    """The setup with the joint torques as they are, and in each other unit."""
    return tuple(("", replace(setup, gain=value * setup.gain)) for value in (1.0, *TORQUE_UNITS.values()))


def wrench_in_units(setup: Setup, field: str) -> Starts:
    """Forces and moments of a force/torque sensor in any two units."""
    return tuple(_scaled(setup, field, force, moment) for force in _FORCES for moment in _MOMENTS)


def wrench_times_units(setup: Setup, field: str) -> Starts:
    """The whole wrench of a force/torque sensor times the value of each unit of force."""
    return tuple(_scaled(setup, field, value, value) for value in _FORCES)


def forces_in_units(setup: Setup, field: str) -> Starts:
    """The forces of a force/torque sensor as they are, and in each other unit."""
    return tuple(_scaled(setup, field, force, 1.0) for force in _FORCES)


def moments_in_units(setup: Setup, field: str) -> Starts:
    """The moments of a force/torque sensor as they are, and in each other unit."""
    return tuple(_scaled(setup, field, 1.0, moment) for moment in _MOMENTS)


def _scaled(setup: Setup, field: str, force: float, moment: float) -> tuple[str, Setup]:
    factors = force ** SCALED["force"] * moment ** SCALED["moment"]
    return "", setup.with_sensor(field, order=setup.sensors[field].order * factors)
