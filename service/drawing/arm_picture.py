"""A picture of an arm's primitives, with its name and the colours of its links."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

from contactsense.robots import Robot
from contactsense.robots.rendering import COLOURS, draw_arm
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
    draw_arm(robot, q, path, coarse)
    mpl.use("Agg")
    with figure_style():
        _frame(robot, path, "coarse" if coarse else "fine")


def _frame(robot: Robot, path: Path, detail: str) -> None:
    """Put title and legend around the picture in the file."""
    from matplotlib import image, pyplot
    from matplotlib.patches import Patch

    views = image.imread(path)
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
