"""The picture of `contactsense bench hold`."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from contactsense.benchmarks.hold.simulate import TIMES
from contactsense.service.drawing.figure_style import figure_style


def draw(held: dict[str, dict[str, list[float]]], trace: np.ndarray, path: Path) -> None:
    """Plot the error against holding time, and the path of a sliding contact.

    Args:
        held: See `contactsense.benchmarks.hold.command.summary`, by the name of the case.
        trace: See `contactsense.benchmarks.hold.command.slid`.
        path: Picture to write.
    """
    with figure_style():
        _draw(held, trace).savefig(path)


def _draw(held: dict[str, dict[str, list[float]]], trace: np.ndarray) -> Figure:
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for number, (name, row) in enumerate(held.items()):
        left.loglog(TIMES, row["error_mm"], "o-", ms=4, color=f"C{number}", label=name)
        left.loglog(TIMES, row["stated_mm"], ":", color=f"C{number}")
    first = next(iter(held.values()))["error_mm"]
    law = first[2] * np.sqrt(TIMES[2] / np.array(TIMES))
    left.loglog(TIMES, law, "--", color="C5", linewidth=1.0, label="1 / sqrt(time)")
    left.set_xlabel("held for / s")
    left.set_ylabel("error, RMS / mm (dotted: stated)")
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    left.legend()
    right.plot(trace[:, 0], 1e3 * trace[:, 1], "--", color="C5", label="truth", zorder=3)
    right.plot(trace[:, 0], 1e3 * trace[:, 2], color="C0", linewidth=1.0, label="found")
    sliding = trace[:, 4] > 0.0
    right.fill_between(
        trace[:, 0], -10.0, 60.0, where=sliding.tolist(), color="C1", alpha=0.15, lw=0, label="phase: slide"
    )
    right.set_ylim(-10.0, 60.0)
    right.set_xlabel("time since the touch / s")
    right.set_ylabel("way along the forearm / mm")
    right.legend()
    return figure
