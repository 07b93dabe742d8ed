"""The report of a calibration: Markdown with plots of residuals before and after."""

from pathlib import Path
from typing import Any

import numpy as np

from contactsense.calibration import Calibration, FreeMotion
from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.residuals.equations import all_residuals
from contactsense.scene import Scene
from contactsense.service.cli.calibration_doubts import as_read_with
from contactsense.service.cli.calibration_page import Section
from contactsense.service.cli.contact_lines import channels, unit_of
from contactsense.service.drawing.figure_style import figure_style

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
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["# Calibration", "", f"Calibrated from {found.seconds:.1f} s of motion without contact.", ""]
    for section in sections:
        lines += [f"## {section.title}", "", *(f"- {line}" for line in section.lines), ""]
    lines += ["## Residuals", ""]
    names = channels(scene)
    shown = np.flatnonzero(np.isfinite(found.after.rms))
    for number, stretch in enumerate(stretches):
        every = max(1, len(stretch.t) // _DOTS)
        old, new = (x[::every][:, shown] for x in residuals_before_and_after(scene, found.scene, stretch))
        touched = [(contact.start, contact.stop) for contact in found.contacts if contact.within(stretch)]
        time = stretch.t[::every] - stretch.t[0]
        with figure_style():
            figure = _residuals(time, old, new, [names[i] for i in shown], touched)
            figure.savefig(folder / f"residuals_{number}.png")
        lines += [f"### {stretch.name}", "", f"![residuals](residuals_{number}.png)", ""]
    lines += _every_parameter(found)
    (folder / "report.md").write_text("\n".join(lines), encoding="utf-8")


def residuals_before_and_after(
    scene: Scene, calibrated: Scene, stretch: FreeMotion
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of a recording that was read with `scene`, by that scene and by the calibrated one, which may
    have other torque constants. Each (N, C) for C channels."""
    now = as_read_with(calibrated, scene, stretch)
    return (
        all_residuals(CalibrationModel.of(scene), stretch, scene.bandwidth),
        all_residuals(CalibrationModel.of(calibrated), now, scene.bandwidth),
    )


def _residuals(
    time: np.ndarray, old: np.ndarray, new: np.ndarray, names: list[str], touched: list[tuple[float, float]]
) -> Any:
    """Residuals (K, C) before and after over time (K,) [s], a panel for each of C channels; `touched`: begin
    and end of what is taken for a contact [s]."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 1.7 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for i, (axes, name) in enumerate(zip(panels, names, strict=True)):
        axes.plot(time, old[:, i], linewidth=0.8, color="0.5", label="before")
        axes.plot(time, new[:, i], linewidth=0.8, color="C0", label="after")
        axes.set_ylabel(f"{name}\n/ {unit_of(name)}")
        for k, (start, stop) in enumerate(touched):
            axes.axvspan(
                start, stop, color="C1", alpha=0.3, linewidth=0, label=None if k else "left out: contact"
            )
    panels[0].legend(loc="upper right", ncols=3)
    panels[-1].set_xlabel("time / s")
    return figure


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
