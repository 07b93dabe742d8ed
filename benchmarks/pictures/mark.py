"""One mark in the picture of time against error, and that picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from rich.table import Table

from contactsense.benchmarks.static_truth.cases import Detail, Noise
from contactsense.service.drawing.figure_style import figure_style
from contactsense.service.drawing.palette import SERIES

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "speed_error.png"
DETAILS: tuple[Detail, ...] = ("coarse", "fine", "skin")
QUANTILES = (0.5, 0.75, 0.95)
FARTHEST = 3.0
"""Error at which a missing answer is drawn [m]."""
MARKS = "osDv^<>PXhpd*"


class Mark(NamedTuple):
    """One method on one arm at one level of noise, for one number of contacts."""

    method: str
    robot: str
    noise: Noise
    contacts: int
    """Number of simultaneous contacts."""
    microseconds: float
    """Time of one answer."""
    error: tuple[float, ...]
    """`QUANTILES` of the distance of a contact from its answer, infinite if an estimate is missing [m]."""
    link_right: float
    """Fraction of the contacts whose answer has the correct link."""

    def as_json(self) -> dict[str, Any]:
        """Plain numbers; infinite ones as None."""
        plain = self._asdict()
        plain["noise"] = self.noise._asdict()
        plain["error"] = [value if np.isfinite(value) else None for value in self.error]
        return plain


def table(marks: Sequence[Mark], samples: int) -> Table:
    """One row per mark."""
    drawn = Table(
        title=f"base sensor and torques, {samples} postures an arm",
        caption=(
            "contacts: number of simultaneous contacts, added one after another; error: "
            "50 / 75 / 95 % quantiles in mm over the contacts, failures included; link right: of the contacts"
        ),
    )
    for name in ("arm", "noise N / Nm / Nm"):
        drawn.add_column(name, no_wrap=True)
    drawn.add_column("contacts", justify="right")
    drawn.add_column("method", no_wrap=True)
    for name in ("us / answer", "error", "link right"):
        drawn.add_column(name, justify="right", no_wrap=True)
    for m in sorted(marks, key=lambda m: (m.robot, m.noise, m.contacts, m.microseconds)):
        drawn.add_row(
            m.robot,
            str(m.noise),
            str(m.contacts),
            m.method,
            f"{m.microseconds:.0f}",
            " / ".join(f"{1e3 * value:.1f}" if np.isfinite(value) else "none" for value in m.error),
            f"{100 * m.link_right:.1f} %",
        )
    return drawn


def draw(marks: Sequence[Mark], path: Path = PICTURE) -> None:
    """Draw a row of panels for each arm and level of noise, with a panel for each number of contacts: medians
    as filled marks, 95 % quantiles as open ones, a colour and a shape for each method."""
    with figure_style():
        figure = _draw(marks)
        figure.savefig(path)
    plt.close(figure)


def _draw(marks: Sequence[Mark]) -> Figure:
    rows = list(dict.fromkeys((m.robot, m.noise) for m in marks))
    columns = sorted({m.contacts for m in marks})
    # Our method first, the others in the order of measurement.
    names = sorted(
        dict.fromkeys(m.method for m in marks), key=lambda name: not name.startswith("contactsense")
    )
    figure, panels = plt.subplots(
        len(rows),
        len(columns),
        figsize=(2.0 + 3.9 * len(columns), 1.3 + 2.7 * len(rows)),
        sharex="col",
        sharey=True,
        squeeze=False,
    )
    drawn = {}
    for row, (robot, noise) in zip(panels, rows, strict=True):
        for axes, contacts in zip(row, columns, strict=True):
            own = [m for m in marks if (m.robot, m.noise, m.contacts) == (robot, noise, contacts)]
            for m in own:
                k = names.index(m.method)
                drawn[m.method] = _draw_mark(axes, m, MARKS[k % len(MARKS)], f"C{k % len(SERIES)}")
            axes.set_xscale("log")
            axes.set_yscale("log")
            level = f"noise {noise}" if any(noise) else "no noise"
            axes.set_title(f"{robot}, {contacts} contact{'s'[: contacts > 1]}, {level}")
        row[0].set_ylabel("error / mm")
        row[0].yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    for axes in panels[-1]:
        axes.set_xlabel("time of one answer / µs")
        wide = np.ptp(np.log10(axes.get_xlim())) > 2.0
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    figure.legend(
        [drawn[name] for name in names],
        names,
        loc="upper center",
        ncols=4,
        title="full: median, open: 95 % quantile of a contact's error (at 3 m: no answer)",
    )
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 1.05 / figure.get_figheight()))
    return figure


def _draw_mark(axes: Axes, m: Mark, marker: str, color: str) -> Any:
    low, high = (1e3 * min(value, FARTHEST) for value in (m.error[0], m.error[-1]))
    axes.plot([m.microseconds] * 2, [low, high], color=color, linewidth=1)
    axes.plot(m.microseconds, high, marker, color=color, fillstyle="none")
    return axes.plot(m.microseconds, low, marker, color=color)[0]
