"""`python -m contactsense.benchmarks.multi_contact.second_places`: missed contacts beside the truth.

The setting of `contactsense.benchmarks.mcp_ep` without noise. Where an answer misses a contact, is the truth
among its explanations, and how much less probable? The first contact that an answer misses ends a run.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from contactsense import Contact
from contactsense.benchmarks.accuracy.static_cases import COLUMNS
from contactsense.benchmarks.compare import NEAR
from contactsense.benchmarks.mcp_ep import CONTACTS, HELD, scene_of, sequence
from contactsense.benchmarks.multi_contact.measure import match
from contactsense.benchmarks.multi_contact.perfect_search import Oracle
from contactsense.benchmarks.peers.touches import Toucher


class Missed(NamedTuple):
    """An answer that misses the contact which was added last, and the truth."""

    run: int
    contacts: int
    """Number of contacts present."""
    links: tuple[int, int]
    """Link of the true contact, and of the answer's that is taken for it."""
    distance: float
    """Between the two [m]."""
    friction: tuple[float, float]
    """Tangential over normal force of both."""
    stated: tuple[float, float]
    """Probability of the explanation with the true contacts (0: not listed), and of the answer."""


def missed(robot: str, runs: int, seed: int, drift: float) -> Iterator[Missed]:
    """The first missed contact of each run; arguments as for `contactsense.benchmarks.mcp_ep.compare`."""
    noise = COLUMNS[0]
    scene = scene_of(robot, noise)
    oracle = Oracle(scene)
    touches = Toucher(scene, seed=seed).draw(runs, CONTACTS, even=True)
    wrench, torque = sequence(touches, noise, seed + 1)
    for i in range(runs):
        known: tuple[Contact, ...] = ()
        for step in range(CONTACTS):
            estimate = oracle.locate(touches.q[i], wrench[i, step], torque[i, step], step + 1, known, drift)
            sets = [(e.contacts, e.probability) for e in estimate.explanations]
            sets = sets or [((contact,), contact.probability) for contact in estimate.contacts]
            truth = list(touches.point_base[i, : step + 1])
            known = sets[0][0]
            if (match(known, truth) <= NEAR).all():
                continue
            force, normal = touches.force_base[i, step], touches.normal_base[i, step]
            answer = known[-1]
            yield Missed(
                run=i,
                contacts=step + 1,
                links=(int(touches.link[i, step]), answer.link_index),
                distance=float(np.linalg.norm(answer.point_base - truth[step])),
                friction=(_ratio(force, normal), _ratio(answer.force_base, answer.normal_base)),
                stated=(sum(p for found, p in sets if (match(found, truth) <= NEAR).all()), sets[0][1]),
            )
            break


def _ratio(force: np.ndarray, normal: np.ndarray) -> float:
    """Tangential over normal force."""
    push = -float(force @ normal)
    return float(np.linalg.norm(force + push * normal)) / push


@click.command()
@click.option("--robot", "names", multiple=True, default=("ur5e",), help="Arm by name, panda, or a URDF.")
@click.option("--runs", default=200, show_default=True, help="Postures with three contacts each.")
@click.option("--seed", default=0, show_default=True, help="Seed of the random numbers.")
@click.option("--drift", default=HELD, show_default=True, help="How well the earlier forces are known [N].")
def main(names: tuple[str, ...], runs: int, seed: int, drift: float) -> None:
    """Print every missed contact beside the true one."""
    table = Table(title=f"missed contacts without noise, forces within {drift:g} N, {runs} runs")
    columns = ("arm", "run", "contacts", "true link", "its friction", "its explanation", "answer's link")
    for name in (*columns, "its friction", "its explanation", "apart"):
        table.add_column(name, justify="right")
    for name in names:
        for row in missed(name, runs, seed, drift):
            table.add_row(
                Path(name).stem, str(row.run), str(row.contacts),
                str(row.links[0]), f"{row.friction[0]:.2f}", f"{100 * row.stated[0]:.0f} %",
                str(row.links[1]), f"{row.friction[1]:.2f}", f"{100 * row.stated[1]:.0f} %",
                f"{1e3 * row.distance:.0f} mm",
            )  # fmt: skip
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
