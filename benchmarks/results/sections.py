"""What stands on the pages: for each section the command that prints it."""

from pathlib import Path
from typing import NamedTuple

TRUTH = "build/truth"
MESHES = f"{TRUTH}/meshes"
GIVEN = Path("../shared/data/truth")
"""Files of the same kind that are not part of the repository."""
MAKE = f"python -m contactsense.benchmarks.truth make --seed 1 --runs 24 --into {TRUTH}"
"""The command that makes the ground truth of all sections but those of the given files."""
PAIRS = f"{TRUTH}_pairs"
MAKE_PAIRS = (
    "python -m contactsense.benchmarks.truth make --robot ur5e --suite motion --seed 2 --runs 80 "
    f"--into {PAIRS}"
)
"""The command that makes more pairs of contacts, by another seed than that with which the localization of
several contacts was tuned."""
DRAW = (
    "python -m contactsense.benchmarks.speed_error --contacts 100 --robot ur3e --robot ur5e "
    f"--truth {TRUTH} --meshes {MESHES}"
)
"""The command that draws speed_error.png: the picture replaces its table."""
PICTURE = "![Time of one answer against its error, for each method and level of detail](speed_error.png)"


class Section(NamedTuple):
    """A heading, a description, and the command whose output follows."""

    heading: str
    about: str
    command: str
    needs: Path | None = None
    """Folder without which the section is left out, from the repository's folder."""


class Page(NamedTuple):
    """A page of docs."""

    name: str
    introduction: str
    sections: tuple[Section, ...]


_FIRST = Page(
    "results.md",
    f"""# Results

Each figure with the command that prints it. `make results` measures everything again on an idle machine and
writes this page and [further_results.md](further_results.md), in less than an hour. It needs the repository
and the package index alone: it begins with the [ground truth](ground_truth.md), which uses nothing of the
library.

    {MAKE}

[Accuracy](accuracy.md) explains the columns. Without `--robot`, `--sensors` and `--noise` the commands print
all arms, sensors and noises of a folder.
""",
    (
        Section(
            "Link and place, static contacts",
            """2000 contacts per arm, 5 to 60 N, on all links, distributed uniformly over the exposed surface.
Noise is the standard deviation of one sample: of each component of base force and base moment, and of each
joint torque.""",
            f"contactsense bench truth {TRUTH} --brief --robot ur3e --robot ur5e",
        ),
        Section(
            "Moving arm",
            "500 Hz, 0.25 N, 0.05 Nm, 1 Nm; holds, slides and impacts of 5 to 60 N. Delay in ms.",
            f"contactsense bench motion {TRUTH} --suite motion --model exact --level 2 "
            "--robot ur3e --robot ur5e",
        ),
        Section(
            "Time per sample",
            "One core, from Python, on the contacts of the demo (0.25 N, 0.05 Nm, 1 Nm), in µs.",
            "contactsense bench speed",
        ),
        Section(
            "From the packet to the WebSocket message",
            """From the departure of the packet at the mock robot to the arrival of its estimate at a
WebSocket client, on one machine.""",
            "contactsense bench latency --seconds 60",
        ),
    ),
)

_FURTHER = Page(
    "further_results.md",
    """# Further results

Written by `make results`, as [results.md](results.md), which says where the contacts come from. Notes under a
table apply to all tables below it.
""",
    (
        Section(
            "With one or two primitives per link",
            "",
            f"contactsense bench truth {TRUTH} --brief --robot ur5e --detail coarse",
        ),
        Section(
            "With the skin of the links",
            "The contact is moved onto the meshes along its line of action.",
            f"contactsense bench truth {TRUTH} --brief --robot ur5e --detail skin --meshes {MESHES}",
        ),
        Section(
            "With the classical pipeline",
            "The link from the sensors, then the contact by the paper's closed form.",
            f"contactsense bench truth {TRUTH} --brief --robot ur5e --method intrinsic",
        ),
        Section(
            "Moving arm, velocities with noise",
            "As [Moving arm](results.md#moving-arm), with velocities as noisy as those of a real UR10e.",
            f"contactsense bench motion {TRUTH} --suite motion --model exact --level 2 --robot ur5e "
            "--velocity-noise 0.001",
        ),
        Section(
            "Calibration over time",
            "As [Calibration](#calibration), some time after the onset, on moving and resting arms.",
            f"contactsense bench motion-calibration {PAIRS} --robot ur5e --level 2",
        ),
        Section(
            "Base sensor alone", "", f"contactsense bench truth {TRUTH} --brief --robot ur5e --sensors base"
        ),
        Section(
            "Joint torques alone",
            "",
            f"contactsense bench truth {TRUTH} --brief --robot ur5e --sensors torques",
        ),
        Section(
            "Compared with the dense posterior",
            "Are the errors the smallest possible ones? See [accuracy](accuracy.md#the-dense-posterior).",
            "python -m contactsense.benchmarks.posterior --contacts 200 --robot ur5e --sensors all "
            f"--noise 0 --noise 0.25 --truth {TRUTH} --meshes {MESHES}",
        ),
        Section(
            "Calibration",
            "Are the stated probabilities and regions right? See [accuracy](accuracy.md#calibration).",
            f"contactsense bench calibration {TRUTH} --brief --robot ur5e --sensors all --sensors base",
        ),
        Section(
            "Where the primitives differ from the link",
            """At edges, in pockets and on ribs the real normal is that of no primitive:
[accuracy](accuracy.md#where-the-primitives-differ-from-the-link).""",
            f"contactsense bench tilt {TRUTH} --robot ur3e --robot ur5e",
        ),
        Section(
            "Two contacts on a moving arm",
            f"""Pairs on different links, one sample per estimate: [several contacts](multi_contact.md). They
are of another seed than that with which the method was tuned, made by
`{MAKE_PAIRS}`.""",
            f"contactsense bench several --robot ur5e --truth {PAIRS}",
        ),
        Section(
            "Time against error",
            """Two and three contacts of 20 N are added one after another on other links. `contactsense` knows
the places of the earlier ones, and their forces to within 0.5 N (with `forces free` not at all). The command
also prints the table.""",
            DRAW,
        ),
        Section(
            "Other methods",
            "What they are, and what the tables say: [other methods](peers.md).",
            f"python -m contactsense.benchmarks.compare --robot ur5e --truth {TRUTH}",
        ),
        Section(
            "Other methods, up to three contacts",
            """Contacts of 20 N, one after another:
[the setting of MCP-EP](peers.md#several-contacts-the-setting-of-mcp-ep).""",
            "python -m contactsense.benchmarks.mcp_ep --runs 200 --robot ur5e",
        ),
        Section(
            "Samples lost at 500 Hz",
            "60 s from the mock robot. Each client runs in its own process.",
            "contactsense bench stream --seconds 60",
        ),
        Section(
            "Given files",
            """Contacts of the same kind on UR5e and UR10e, made by others, that are not part of the
repository. Where their folder is absent, this section is left out.""",
            f"contactsense bench truth {GIVEN} --brief",
            GIVEN,
        ),
    ),
)

PAGES = (_FIRST, _FURTHER)
