"""Write docs/results.md: every number is printed by a command; the page states machine and date. Run: make
results.

What a command has printed is kept in build/results. A run that was interrupted goes on from there, as long as
neither the commit nor a file outside docs has changed.
"""

import hashlib
import os
import platform
import shlex
import subprocess
import time
from collections.abc import Iterator
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PRINTED = ROOT / "build" / "results"
"""Folder of what the commands have printed."""
TRUTH = "../shared/data/truth"
MESHES = "../shared/data/ur_visual"
_FRAME = "━─┏┓┗┛┡┩└┘├┤┳┻╇┴┼┬"
"""Characters of the horizontal lines of a table's frame."""

INTRODUCTION = """# Results

Each figure with the command that prints it. `make results` measures everything again and writes this page.
It needs an idle machine and the ground truth in `../shared/data/truth`, which was made independently of
this project with MuJoCo and the arms' visual meshes. [Accuracy](accuracy.md) explains the columns. Notes
under a table apply to all tables below it. Without `--robot`, `--sensors` and `--noise` the commands print
all arms, sensors and noises.
"""

DRAWN = "python -m contactsense.benchmarks.speed_error --contacts 100"
"""The command that draws speed_error.png: the picture replaces its table."""
PICTURE = "![Time of one answer against its error, for each method and level of detail](speed_error.png)"

SECTIONS = (
    (
        "Link and place, static contacts",
        """2000 contacts per arm, 5 to 60 N, on all links, distributed uniformly over the exposed surface.
Noise is the standard deviation of one sample: of each component of base force and base moment, and of each
joint torque. Link and place are estimated together; `--method torques_first` shows what that adds.""",
        f"contactsense bench truth {TRUTH} --brief",
    ),
    (
        "With one or two primitives per link",
        "",
        f"contactsense bench truth {TRUTH} --brief --robot ur5e --detail coarse",
    ),
    (
        "With the skin of the links",
        "The contact is moved onto the meshes along its line of action.",
        f"contactsense bench truth {TRUTH} --brief --robot ur5e --detail skin --meshes {MESHES}",
    ),
    ("Base sensor alone", "", f"contactsense bench truth {TRUTH} --brief --robot ur5e --sensors base"),
    ("Joint torques alone", "", f"contactsense bench truth {TRUTH} --brief --robot ur5e --sensors torques"),
    (
        "Compared with the dense posterior",
        "How close the errors are to the best possible ones: [accuracy](accuracy.md#the-dense-posterior).",
        "python -m contactsense.benchmarks.posterior --contacts 200 --robot ur5e --sensors all "
        "--noise 0 --noise 0.25",
    ),
    (
        "Calibration",
        "Are the stated probabilities and regions right? See [accuracy](accuracy.md#calibration).",
        f"contactsense bench calibration {TRUTH} --brief --robot ur5e --sensors all --sensors base",
    ),
    (
        "Time against error",
        """Two and three contacts of 20 N are added one after another on other links. `contactsense` knows the
places of the earlier ones, and their forces to within 0.5 N (with `forces free` not at all). The command also
prints the table.""",
        DRAWN,
    ),
    (
        "Time per sample",
        """One core, from Python, on the contacts of the demo (0.25 N, 0.05 Nm, 1 Nm), in µs.""",
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
"""Heading, description, command."""


def _machine() -> str:
    model = platform.processor() or platform.machine()
    cpu = Path("/proc/cpuinfo")
    if cpu.exists():
        names = [
            line.split(":", 1)[1].strip() for line in cpu.read_text().splitlines() if "model name" in line
        ]
        model = names[0] if names else model
    return f"{date.today().isoformat()}, {os.cpu_count()} cores, {model}, Python {platform.python_version()}"


def without_frame(output: str, notes: set[str] | None = None) -> str:
    """Output of a command, with tables without box-drawing frames and with columns as narrow as possible.

    A rule remains below each header and between groups of rows. Titles, captions and numbers are unchanged,
    but ` / ` and ` %` within a cell become `/` and `%`.

    Args:
        output: Output of the command.
        notes: Titles and captions that are already on the page: they are omitted. New ones are added.
    """
    lines: list[str] = []
    notes = set() if notes is None else notes
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
        elif "━" not in output:
            lines.append(line)
        elif line.strip() not in notes:
            notes.add(line.strip())
            lines.append(line.strip())
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


def source_version(folder: Path) -> str:
    """The commit and all changes since, but for those in docs; empty where git does not tell."""
    commands = ("git rev-parse HEAD", "git diff HEAD -- . :!docs")
    try:
        found = [
            subprocess.run(line.split(), cwd=folder, capture_output=True, text=True) for line in commands
        ]
    except FileNotFoundError:
        return ""
    return "" if any(one.returncode for one in found) else "".join(one.stdout for one in found)


def printed_by(command: str, version: str, folder: Path = PRINTED) -> str:
    """What a command prints: run now, or kept in `folder` from an earlier run of the same version.

    Args:
        command: Run in the repository's folder.
        version: Of `source_version`; an empty one is not kept.
        folder: Made if need be.

    Raises:
        subprocess.CalledProcessError: The command fails.
    """
    key = hashlib.sha256(f"{version}\n{command}".encode()).hexdigest()
    kept = folder / f"{key}.txt"
    if version and kept.exists():
        print(f"{command}: kept", flush=True)
        return kept.read_text(encoding="utf-8")
    print(command, end=": ", flush=True)
    begin = time.monotonic()
    done = subprocess.run(shlex.split(command), cwd=ROOT, capture_output=True, text=True, check=True)
    print(f"{time.monotonic() - begin:.0f} s", flush=True)
    if version:
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = kept.with_suffix(".part")
        unfinished.write_text(done.stdout, encoding="utf-8")
        unfinished.replace(kept)
    return done.stdout


def _page() -> Iterator[str]:
    yield INTRODUCTION
    yield f"Measured on: {_machine()}.\n"
    notes: set[str] = set()
    version = source_version(ROOT)
    for heading, about, command in SECTIONS:
        printed = printed_by(command, version).strip("\n")
        printed = "\n".join(line.rstrip() for line in printed.splitlines())
        lines = without_frame(printed, notes)
        yield f"## {heading}\n"
        if about:
            yield f"{about}\n"
        yield f"    {command}\n"
        yield f"{PICTURE}\n" if command == DRAWN else f"```\n{lines}\n```\n"


if __name__ == "__main__":
    (ROOT / "docs" / "results.md").write_text("\n".join(_page()))
