"""The report of a calibration: Markdown with plots of residuals before and after."""

from pathlib import Path

import numpy as np

from contactsense.calibration import Calibration, FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.recording_residuals import residuals
from contactsense.scene import Scene
from contactsense.service.cli.calibration_page import Section, channels

_DOTS = 4000
"""Largest number of points of a curve."""


def write_report(
    folder: Path,
    found: Calibration,
    sections: tuple[Section, ...],
    stretches: list[FreeMotion],
    scene: Scene,
) -> None:
    """Write report.md and a picture per recording into `folder`.

    Args:
        folder: Output folder; created if it does not exist.
        found: Result of the calibration.
        sections: The page on it.
        stretches: The recordings.
        scene: The scene before the calibration.

    Raises:
        OSError: The folder cannot be written.
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    lines = ["# Calibration", "", f"Calibrated from {found.seconds:.1f} s of motion without contact.", ""]
    for section in sections:
        lines += [f"## {section.title}", "", *(f"- {line}" for line in section.lines), ""]
    lines += ["## Residuals", ""]
    names = channels(scene)
    before, after_ = CalibrationModel.of(scene), CalibrationModel.of(found.scene)
    shown = np.flatnonzero(np.isfinite(found.after.rms))
    for number, stretch in enumerate(stretches):
        every = max(1, len(stretch.t) // _DOTS)
        old = residuals(before, stretch, scene.bandwidth)[::every]
        new = residuals(after_, stretch, scene.bandwidth)[::every]
        figure = Figure(figsize=(10.0, 1.6 * len(shown)), layout="constrained")
        for place, i in enumerate(shown):
            axes = figure.add_subplot(len(shown), 1, place + 1)
            axes.plot(stretch.t[::every] - stretch.t[0], old[:, i], lw=0.6, color="0.7", label="before")
            axes.plot(stretch.t[::every] - stretch.t[0], new[:, i], lw=0.8, color="C0", label="after")
            axes.set_ylabel(f"{names[i]}\n[{'N' if names[i].startswith('base force') else 'Nm'}]", fontsize=7)
            axes.grid(alpha=0.3)
        for contact in found.contacts:
            if (
                contact.recording == stretch.name
                and contact.first_row >= stretch.row_of(0)
                and (contact.last_row <= stretch.row_of(-1))
            ):
                for axes in figure.axes:
                    axes.axvspan(contact.start, contact.stop, color="C3", alpha=0.15, lw=0)
        figure.axes[0].legend(loc="upper right", fontsize=7)
        figure.axes[-1].set_xlabel("time [s]")
        figure.savefig(folder / f"residuals_{number}.png", dpi=90)
        lines += [f"### {stretch.name}", "", f"![residuals](residuals_{number}.png)", ""]
    lines += _every_parameter(found)
    (folder / "report.md").write_text("\n".join(lines), encoding="utf-8")


def _every_parameter(found: Calibration) -> list[str]:
    lines = [
        "## Every parameter",
        "",
        "| parameter | before | after | std | unit |",
        "| --- | --- | --- | --- | --- |",
    ]
    for value in (*found.values, *found.inertia):
        after = (
            f"kept: {value.kept.removesuffix(': kept')} |"
            if value.kept
            else f"{value.after:.5g} | {value.std:.2g}"
        )
        lines.append(f"| {value.entry.name} | {value.before:.5g} | {after} | {value.entry.unit} |")
    return [*lines, "", *(f"- {warning}" for warning in found.warnings), ""]
