"""Entry point: `contactsense COMMAND ...`. Commands are imported only when they are called."""

import errno
import os
import signal
import sys

import click

from contactsense.service.cli.lazy import LazyGroup

COMMANDS = {
    "demo": (
        "contactsense.service.cli.demo:demo",
        "Touch a simulated arm; compare estimates and ground truth.",
    ),
    "robots": (
        "contactsense.service.cli.robots:robots",
        "List the arms, or show one: links, joints and primitives.",
    ),
    "scene": (
        "contactsense.service.cli.scene:scene",
        "Write a commented scene file, or show what a scene says.",
    ),
    "check": ("contactsense.service.cli.check:check", "Check a scene against motion without contact."),
    "excite": ("contactsense.service.cli.excite:excite", "Propose a motion for `contactsense calibrate`."),
    "calibrate": (
        "contactsense.service.cli.calibrate:calibrate",
        "Calibrate a scene from motion without contact.",
    ),
    "map": (
        "contactsense.service.cli.map:surface_map",
        "Show what a scene's sensors can tell of pushes on each link.",
    ),
    "decompose": (
        "contactsense.service.cli.decompose:decompose",
        "Fit convex primitives to an arm, a tool or a body.",
    ),
    "serve": ("contactsense.service.cli.serve:serve", "Serve estimates over HTTP and WebSocket."),
    "view": ("contactsense.service.cli.view:view", "Show an arm and its contacts in a browser."),
    "reactions": ("contactsense.service.cli.reactions:reactions", "Check rules for reactions to contacts."),
    "mock": (
        "contactsense.service.cli.mock:mock",
        "Simulate a UR arm, its controller and force/torque sensor.",
    ),
    "record": (
        "contactsense.service.cli.record:record",
        "Record a robot and its sensors, or convert a recording.",
    ),
    "analyze": ("contactsense.service.cli.analyze:analyze", "Find what touched the arm in recordings."),
    "paper": (
        "contactsense.benchmarks.solvers.paper_command:paper",
        "Reproduce the tables of Bicchi, Salisbury and Brock (1993).",
    ),
    "bench": ("contactsense.service.cli.bench:bench", "Measure speed and error."),
}
"""Command name -> import path of its click command and its line in the help text, in the order in which a
user needs them."""


cli = LazyGroup(
    COMMANDS,
    sections={
        "First steps": "demo",
        "Your cell": "scene",
        "Live": "serve",
        "Recordings": "record",
        "Evidence": "paper",
    },
    name="contactsense",
    help="Estimate where a robot arm is being touched.",
    context_settings={"help_option_names": ["-h", "--help"]},
)
click.version_option(package_name="contactsense")(cli)


def main() -> None:
    """Run the command line: exit status 0 on success, 1 on failure, 2 on wrong usage; one line per error."""
    # Read when numpy is imported. Matrices are small here: threads for one mostly wait, and where other
    # processes work beside, `check` takes several times as long with them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Like Ctrl-C: commands end their processes and close their files.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        status = cli.main(standalone_mode=False)
    except click.UsageError as error:
        print(f"contactsense: {error.format_message()}", file=sys.stderr)
        sys.exit(2)
    except click.ClickException as error:
        print(f"contactsense: {error.format_message()}", file=sys.stderr)
        sys.exit(1)
    except click.Abort:
        print("contactsense: interrupted", file=sys.stderr)
        sys.exit(1)
    except OSError as error:
        # Without the name of a file it is the output, such as a file on a full disk.
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        print(f"contactsense: cannot write the output: {error.strerror}", file=sys.stderr)
        # What is still buffered cannot be written, either: Python would try it again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    sys.exit(status if isinstance(status, int) else 0)
