"""`contactsense demo --react`: results without and with a reaction, side by side."""

import json
import tempfile
from pathlib import Path

import click
from rich.console import Console
from rich.text import Text

from contactsense.service.demo.processes import Stage
from contactsense.service.demo.reaction_runs import DECELERATION, LEVEL, with_reactions
from contactsense.service.demo.sweeps import SWEEPS, Collision, without_reaction

_WIDTHS = (16, 12, 11, 8, 15, 8)
_HEADS = ("touched link", "at", "without", "with", "without", "with")


def compare(console: Console, port: int, as_json: bool) -> int:
    """Run the sweeps without and with a reaction, and print both; returns 0 only if each peak force
    decreased.

    Args:
        console: Where to print.
        port: Port of the service; 0: any free port.
        as_json: Print only JSON.

    Raises:
        ChildError: Service or arm did not start.
        ClientError: The service ended.
    """
    if not as_json:
        console.print(
            "A simulated UR5e sweeps into padded posts, with three of its links.\n"
            f"The rule: above {LEVEL:g} N on any link, stop it at {DECELERATION:g} rad/s^2."
        )
    without = [without_reaction(sweep) for sweep in SWEEPS]
    if not as_json:
        console.print("The service starts; the very first time it compiles its kernels, a minute or two.")
    with tempfile.TemporaryDirectory() as folder, Stage("ur5e", port) as stage:
        reacted = with_reactions(stage, Path(folder))
    pairs = list(zip(SWEEPS, without, reacted, strict=True))
    better = all(a is not None and b is not None and b.peak_force < a.peak_force for _, a, b in pairs)
    if as_json:
        rows = [
            {"obstacle": sweep.obstacle, "without": a and a.as_dict(), "with": b and b.as_dict()}
            for sweep, a, b in pairs
        ]
        click.echo(json.dumps({"force_level": LEVEL, "deceleration": DECELERATION, "collisions": rows}))
        return 0 if better else 1
    over = "peak force".rjust(sum(_WIDTHS[:4])) + "stopping distance".rjust(sum(_WIDTHS[4:]))
    console.print(Text(f"{over}\n{_row(_HEADS)}", style="bold"))
    for sweep, before, after in pairs:
        console.print(Text(_line(sweep.obstacle, before, after)))
    console.print(
        "Without a reaction the arm continues until its controller finds that the joints do not follow."
        if better
        else Text("The reaction did not make every peak force smaller.", style="bold red")
    )
    return 0 if better else 1


def _line(obstacle: str, without: Collision | None, reacted: Collision | None) -> str:
    if without is None or reacted is None:
        return f"{obstacle}: not touched {'without' if without is None else 'with'} a reaction"
    return _row(
        (
            reacted.link,
            f"{reacted.speed:.2f} m/s",
            f"{without.peak_force:.0f} N",
            f"{reacted.peak_force:.0f} N",
            f"{1e3 * without.stopping_distance:.0f} mm",
            f"{1e3 * reacted.stopping_distance:.0f} mm",
        )
    )


def _row(cells: tuple[str, ...]) -> str:
    return "".join(cell.rjust(width) for cell, width in zip(cells, _WIDTHS, strict=True))
