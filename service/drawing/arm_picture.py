"""A picture of an arm's primitives, with its name and the colours of its links."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

from contactsense.robots import Robot
from contactsense.robots.surface.rendering import COLOURS, render_arm
from contactsense.service.drawing.figure_style import figure_style

_DENSITY = 100.0
"""Pixels per inch of the views."""


def draw_arm_picture(robot: Robot, q: np.ndarray, path: Path, coarse: bool) -> None:
    """Write a PNG of an arm seen from two sides.

    Args:
        robot: The arm.
        q: Joint positions, shape (n,) [rad].
        path: Of the PNG.
        coarse: Whether to show the coarse level of detail instead of the fine one.

    Raises:
        OSError: the file cannot be written.
        ValueError: the robot has no primitives, or `q` is no posture of it.
    """
    views = render_arm(robot, q, coarse)
    mpl.use("Agg")
    with figure_style():
        _write(robot, views, path, "coarse" if coarse else "fine")


def _write(robot: Robot, views: np.ndarray, path: Path, detail: str) -> None:
    """Write the views, shape (rows, columns, 3), with title and legend around them."""
    from matplotlib import pyplot
    from matplotlib.patches import Patch

    rows, columns = views.shape[:2]
    figure, axes = pyplot.subplots(
        figsize=(columns / _DENSITY, rows / _DENSITY + 1.0), dpi=_DENSITY, layout="constrained"
    )
    axes.imshow(views)
    axes.set_axis_off()
    legend = [
        Patch(color="#{:02x}{:02x}{:02x}".format(*COLOURS[i % len(COLOURS)]), label=link.name)
        for i, link in enumerate(robot.links)
        if (link.coarse if detail == "coarse" else link.primitives)
    ]
    figure.legend(handles=legend, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(f"{robot.name}: primitives of the {detail} level, seen from two sides")
    try:
        figure.savefig(path, format="png", dpi=_DENSITY)
    finally:
        pyplot.close(figure)
