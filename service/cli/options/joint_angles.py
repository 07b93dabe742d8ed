"""Joint angles as an option of a command: degrees, separated by commas."""

from math import degrees, isfinite, pi

import click
import numpy as np


def joint_angles(option: str, text: str, joints: int) -> np.ndarray:
    """Parse the joint angles of an arm. If they look like radians, a warning goes to standard error.

    Args:
        option: Name of the option, for errors.
        text: Angles in degrees, separated by commas.
        joints: Number of joints, n.

    Returns:
        Joint positions, shape (n,) [rad].

    Raises:
        click.UsageError: the text is not that many finite numbers.
    """
    try:
        angles = [float(angle) for angle in text.split(",")]
    except ValueError:
        angles = []
    if len(angles) != joints or not all(map(isfinite, angles)):
        raise click.UsageError(
            f"{option}: expected {joints} angles in degrees, separated by commas, got {text!r}"
        )
    # Postures in degrees are seldom that small, and then seldom have decimals.
    if max(map(abs, angles)) <= 2.0 * pi and not all(angle.is_integer() for angle in angles):
        meant = ",".join(f"{degrees(angle):.4g}" for angle in angles)
        click.echo(f"warning: {option}: degrees are expected; if {text} is in rad: {meant}", err=True)
    return np.asarray(np.radians(angles))
