"""Write docs/results.md: every figure printed by a command, with the machine and the day. Run: make
results."""

import os
import platform
import shlex
import subprocess
from collections.abc import Iterator
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TRUTH = "../shared/data/truth"
_FRAME = "━─┏┓┗┛┡┩└┘├┤┳┻╇┴┼┬"
"""Characters of which the horizontal lines of a table's frame are made."""

INTRODUCTION = """# Results

Each figure with the command that prints it. `make results` measures everything again and writes this page.
It needs an idle machine and the ground truth in `../shared/data/truth`, which was made independently of
this project with MuJoCo and the arms' visual meshes. [Accuracy](accuracy.md) explains the columns. Other
pages have figures of their own: [solvers](solvers.md), [motion](motion.md), [several
contacts](multi_contact.md), [calibration](calibration.md), [geometry](geometry.md), [other
methods](peers.md).
"""

DRAWN = "python -m contactsense.benchmarks.speed_error --contacts 100"
"""The command that draws speed_error.png: the picture stands for its table."""
PICTURE = "![Time of one answer against its error, for each method and level of detail](speed_error.png)"

SECTIONS = (
    (
        "Link and place, static contacts",
        """2000 contacts per arm, 5 to 60 N, on all links, distributed uniformly over the exposed surface.
Noise is the standard deviation of one sample: of each component of the base force, of each
component of the base moment, and of each joint torque. Link and place are estimated together.""",
        f"contactsense bench truth {TRUTH} --brief",
    ),
    (
        "With one or two primitives per link",
        "`detail: coarse`.",
        f"contactsense bench truth {TRUTH} --brief --detail coarse",
    ),
    (
        "With the skin of the links",
        "`detail: skin`: the contact is moved onto the meshes along its line of action.",
        f"contactsense bench truth {TRUTH} --brief --detail skin --meshes ../shared/data/ur_visual",
    ),
    (
        "With the link estimated first",
        """The link with the best evidence from base wrench and joint torques is chosen first, then the place
on it. The difference from the first table is what the geometry adds.""",
        f"contactsense bench truth {TRUTH} --brief --method torques_first",
    ),
    ("Base sensor alone", "", f"contactsense bench truth {TRUTH} --brief --sensors base"),
    ("Joint torques alone", "", f"contactsense bench truth {TRUTH} --brief --sensors torques"),
    (
        "Compared with the dense posterior",
        "How close they are to the best possible estimates: see [accuracy](accuracy.md#the-dense-posterior).",
        "python -m contactsense.benchmarks.posterior --contacts 200",
    ),
    (
        "Calibration",
        "Whether the stated probabilities and regions are right: see [accuracy](accuracy.md#calibration).",
        f"contactsense bench calibration {TRUTH} --brief",
    ),
    (
        "Time against error",
        """One contact: the ground truth. Two and three: further contacts
of 20 N are added one after another on other links, at places that the ground truth touches in
other postures. Errors are taken after the last contact was added, with estimates assigned to
contacts. `contactsense` knows the contacts that it found before, and that their forces stay
within 0.5 N; with `forces free`, and for the filter, it knows nothing of the forces. Methods for
one contact appear with one contact only. Times for several contacts are of single calls from
Python, those for one contact of a batch.""",
        DRAWN,
    ),
    (
        "Time per sample",
        """One core, from Python, on the contacts of the demo (0.25 N, 0.05 Nm, 1 Nm), in µs. Calls of
Pinocchio's RNEA for a 6-joint arm alternate with the calls that are measured.""",
        "contactsense bench speed",
    ),
    (
        "Samples lost at 500 Hz",
        "60 s from the mock robot. Each client runs in its own process.",
        "contactsense bench stream --seconds 60",
    ),
    (
        "From the packet to the WebSocket message",
        """From the departure of the packet at the mock robot to the arrival of its estimate at a WebSocket
client, on one machine.""",
        "contactsense bench latency --seconds 60",
    ),
)
"""Heading, what it is about, command."""


def _machine() -> str:
    model = platform.processor() or platform.machine()
    cpu = Path("/proc/cpuinfo")
    if cpu.exists():
        names = [
            line.split(":", 1)[1].strip() for line in cpu.read_text().splitlines() if "model name" in line
        ]
        model = names[0] if names else model
    return f"{date.today().isoformat()}, {os.cpu_count()} cores, {model}, Python {platform.python_version()}"


def without_frame(output: str) -> str:
    """What a command printed, its tables without box-drawing frames and in columns as narrow as they can be.

    A rule is left below each header and between groups of rows. Titles, captions and numbers stay as they
    are, but ` / ` and ` %` within a cell become `/` and `%`.
    """
    lines: list[str] = []
    rows: list[list[str] | None] = []
    for line in output.splitlines():
        if line[:1] in ("┃", "│"):
            rows.append(line[1:-1].replace("┃", "│").split("│"))
        elif line and set(line) <= set(_FRAME):
            if line[0] in "┡├":
                rows.append(None)
            if line[0] == "└":
                lines += _aligned(rows)
                rows = []
        else:
            lines.append(line.strip() if "━" in output else line)
    return "\n".join(lines)


def _aligned(rows: list[list[str] | None]) -> Iterator[str]:
    columns = list(zip(*(row for row in rows if row is not None), strict=True))
    right = [any(cell.startswith("  ") and cell.strip() for cell in column) for column in columns]
    widths = [max(len(_short(cell)) for cell in column) for column in columns]
    for row in rows:
        if row is None:
            yield "─" * (sum(widths) + 2 * len(widths) - 2)
        else:
            yield "  ".join(
                _short(cell).rjust(width) if to_right else _short(cell).ljust(width)
                for cell, width, to_right in zip(row, widths, right, strict=True)
            ).rstrip()


def _short(cell: str) -> str:
    return cell.strip().replace(" / ", "/").replace(" %", "%")


def _page() -> Iterator[str]:
    yield INTRODUCTION
    yield f"Measured on: {_machine()}.\n"
    for heading, about, command in SECTIONS:
        print(command, flush=True)
        done = subprocess.run(shlex.split(command), cwd=ROOT, capture_output=True, text=True, check=True)
        lines = without_frame("\n".join(line.rstrip() for line in done.stdout.strip("\n").splitlines()))
        yield f"## {heading}\n"
        if about:
            yield f"{about}\n"
        yield f"    {command}\n"
        yield f"{PICTURE}\n" if command == DRAWN else f"```\n{lines}\n```\n"


if __name__ == "__main__":
    (ROOT / "docs" / "results.md").write_text("\n".join(_page()))
