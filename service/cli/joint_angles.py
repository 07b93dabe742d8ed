"""Joint angles as an option of a command: degrees, separated by commas."""

from math import isfinite

import click
import numpy as np


def joint_angles(option: str, text: str, joints: int) -> np.ndarray:
    """Parse the joint angles of an arm.

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
    return np.asarray(np.radians(angles))
