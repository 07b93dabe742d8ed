"""The picture of `contactsense bench hold`."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from contactsense.benchmarks.hold.command import TIMES


def draw(held: dict[str, dict[str, list[float]]], trace: np.ndarray, path: Path) -> None:
    """Plot the error against holding time, and the path of a sliding contact.

    Args:
        held: See `contactsense.benchmarks.hold.command.summary`, by the name of the case.
        trace: See `contactsense.benchmarks.hold.command.slid`.
        path: Picture to write.
    """
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for number, (name, row) in enumerate(held.items()):
        left.loglog(TIMES, row["error_mm"], "o-", ms=3, color=f"C{number}", label=name)
        left.loglog(TIMES, row["stated_mm"], ":", color=f"C{number}")
    first = next(iter(held.values()))["error_mm"]
    law = first[2] * np.sqrt(TIMES[2] / np.array(TIMES))
    left.loglog(TIMES, law, "k--", lw=0.8, label="1 / sqrt(time)")
    left.set_xlabel("held for [s]")
    left.set_ylabel("error, RMS [mm]; dotted: stated")
    left.grid(alpha=0.3, which="both")
    left.legend(fontsize=7)
    right.plot(trace[:, 0], 1e3 * trace[:, 1], "k--", lw=1.0, label="truth")
    right.plot(trace[:, 0], 1e3 * trace[:, 2], color="C0", lw=0.8, label="found")
    sliding = trace[:, 4] > 0.0
    right.fill_between(
        trace[:, 0], -10.0, 60.0, where=sliding.tolist(), color="C1", alpha=0.15, lw=0, label="phase: slide"
    )
    right.set_ylim(-10.0, 60.0)
    right.set_xlabel("time since the touch [s]")
    right.set_ylabel("way along the forearm [mm]")
    right.grid(alpha=0.3)
    right.legend(fontsize=7)
    figure.savefig(path, dpi=100)
