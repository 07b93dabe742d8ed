"""Write docs/results.md: every figure printed by a command, with the machine and the day. Run: make
results."""

import os
import platform
import shlex
import subprocess
from collections.abc import Iterator
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
TRUTH = "../shared/data/truth"

INTRODUCTION = """# Results

What was measured, with the command that prints it. `make results` writes this page anew; it needs the ground
truth in `../shared/data/truth` (MuJoCo and the visual meshes, made independently of this project) and an idle
machine. Other pages have their own figures: [the solvers](solvers.md), [contacts in motion](motion.md),
[several contacts](several.md), [calibration](calibration.md), [what others do](peers.md).
"""

SECTIONS = (
    (
        "Link and place, static contacts",
        """2000 contacts per arm, 5 to 60 N, on all links, area-uniform on the exposed surface. Noise is that
of each component of base force, base moment and each joint torque, of one sample. Link and place are decided
together.""",
        f"contactsense bench truth {TRUTH} --brief",
    ),
    (
        "The same, on one or two bodies a link",
        "`detail: coarse`.",
        f"contactsense bench truth {TRUTH} --brief --detail coarse",
    ),
    (
        "The same, on the links' skin",
        "`detail: skin`: the place is moved onto the meshes along the line of the force.",
        f"contactsense bench truth {TRUTH} --brief --detail skin --meshes ../shared/data/ur_visual",
    ),
    (
        "The same, the link decided by the torques first",
        """What a gate in front of a locator does: the link of the best evidence from base wrench and torques,
then the place on it. The difference is what geometry adds.""",
        f"contactsense bench truth {TRUTH} --brief --method torques_first",
    ),
    ("Base sensor alone", "", f"contactsense bench truth {TRUTH} --brief --sensors base"),
    ("Joint torques alone", "", f"contactsense bench truth {TRUTH} --brief --sensors torques"),
    (
        "Beside the dense posterior",
        "How near that is to the best possible answers: see [the yardstick](yardstick.md).",
        "python -m benchmarks.posterior --contacts 200",
    ),
    (
        "Calibration",
        "Whether the stated probabilities and regions are true: see [the yardstick](yardstick.md).",
        f"contactsense bench calibration {TRUTH} --brief",
    ),
    (
        "Time against error",
        """The figures of the picture above. One contact: the ground truth's. Two and three: further ones of
20 N come to it one after another on other links, at places that the ground truth touches in other postures;
an answer is that after the last has come, and each contact is given the answer that is meant for it. Ours
knows what it found before, and that the forces there stay within 0.5 N, or nothing of the forces (`forces
free`), as the filter; methods for one contact are in the first column only. Times for several contacts are
of single calls from Python, those for one of a batch.""",
        "python -m benchmarks.speed_error --contacts 100",
    ),
    (
        "Time per sample",
        """One core, from Python, on the demonstration's contacts (0.25 N, 0.05 Nm, 1 Nm). Pinocchio's RNEA of
a 6-joint arm is called from Python in turn with what is measured.""",
        "contactsense bench speed",
    ),
    (
        "Samples lost at 500 Hz",
        "60 s from the mock robot, each reader in a process of its own.",
        "contactsense bench stream --seconds 60",
    ),
    (
        "From the packet to the WebSocket message",
        "From the mock's packet leaving to the estimate at a WebSocket client, all on one machine.",
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


def _page() -> Iterator[str]:
    yield INTRODUCTION
    yield f"Measured on: {_machine()}.\n"
    yield "![Time of one answer against its error, for each method and level of detail](speed_error.png)\n"
    for heading, about, command in SECTIONS:
        print(command, flush=True)
        done = subprocess.run(shlex.split(command), cwd=ROOT, capture_output=True, text=True, check=True)
        lines = "\n".join(line.rstrip() for line in done.stdout.strip("\n").splitlines())
        yield f"## {heading}\n"
        if about:
            yield f"{about}\n"
        yield f"    {command}\n\n```\n{lines}\n```\n"


if __name__ == "__main__":
    (ROOT / "docs" / "results.md").write_text("\n".join(_page()))
