"""Draw docs/speed_error.png: time of one sample against its error, one mark per level of detail."""

import json
import subprocess
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt

ROOT = Path(__file__).parents[1]
LEVELS = {"coarse": "^", "fine": "o", "skin": "s"}
COLORS = {"ur5e": "tab:blue", "ur10e": "tab:orange"}


def results(detail: str) -> list[dict[str, Any]]:
    command = [
        "contactsense", "bench", "truth", "../shared/data/truth",
        "--detail", detail, "--meshes", "../shared/data/ur_visual", "--json",
    ]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    found: list[dict[str, Any]] = json.loads(done.stdout)["results"]
    return found


def draw() -> None:
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.0), sharey=True)
    for detail, marker in LEVELS.items():
        for r in results(detail):
            noise = tuple(r["noise"].values())
            if noise not in ((0.0, 0.0, 0.0), (0.25, 0.05, 1.0)):
                continue
            axis = axes[0] if noise[0] == 0.0 else axes[1]
            error = r["error_mm_clear"]
            time = r["microseconds_per_sample"]
            axis.plot([time, time], [error["median"], error["p95"]], color=COLORS[r["robot"]], linewidth=1)
            axis.plot(time, error["median"], marker, color=COLORS[r["robot"]], label=f"{r['robot']} {detail}")
            axis.plot(time, error["p95"], marker, color=COLORS[r["robot"]], fillstyle="none")
    for axis, title in zip(axes, ("no noise", "0.25 N, 0.05 Nm, 1 Nm"), strict=True):
        axis.set_yscale("log")
        axis.set_xlim(left=0)
        axis.set_title(title)
        axis.set_xlabel("time of one sample [us]")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("error [mm]: median (full), 95 % (open)")
    axes[1].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(ROOT / "docs" / "speed_error.png", dpi=110)


if __name__ == "__main__":
    draw()
