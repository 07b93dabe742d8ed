"""`python -m contactsense.benchmarks.undecided`: are several contacts missed by the search, or are they not
determined by the measurement?

The setting of `contactsense.benchmarks.mcp_ep`. The search is also started at the truth, and the evidence of
its result is compared with that of the estimate. If the truth's evidence is clearly higher, a better search
would have found it; otherwise no search can, because the measurement and the prior do not determine the
answer.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import Contact
from contactsense.benchmarks.compare import NEAR
from contactsense.benchmarks.mcp_ep import CONTACTS, HELD, scene_of, sequence
from contactsense.benchmarks.multi_contact.measure import match
from contactsense.benchmarks.multi_contact.perfect_search import Oracle
from contactsense.benchmarks.peers.touches import Toucher, Touches
from contactsense.benchmarks.static_truth.cases import COLUMNS, Noise

TOLERANCE = 1.0
"""Difference in log evidence within which two explanations count as equally good."""
KNOWN_FORCES: dict[str, float | None] = {"forces held": HELD, "forces free": None}
"""How a further contact is added, and what is known about the other forces, see `mcp_ep.HELD`."""


class Row(NamedTuple):
    """Estimates of runs in which all contacts before the last were found, or of all runs for `at once`."""

    contacts: int
    arriving: str
    runs: int
    found: float
    """Fraction in which all contacts are found within `NEAR`."""
    better: float
    """Fraction in which they are not, and the true explanation has clearly better evidence."""
    alike: float
    """Fraction in which they are not, and its evidence is about equal."""
    worse: float
    """Fraction in which they are not, and its evidence is clearly worse, or the search from the truth leaves
    it."""
    perfect: float
    """Fraction in which an explanation that is as good as the answer or better has all contacts within
    `NEAR`: the upper limit for any search."""
    lined: float
    """Fraction in which they are not, and an answer is within `NEAR` of the line of the force that is
    farthest from its answer: the line intersects the arm more than once."""
    stated: float
    """Mean probability that the answer states."""


class Outcome(NamedTuple):
    """Comparison of one answer with the truth."""

    found: bool
    holds: bool
    """Whether the search that starts at the truth stays within `NEAR`."""
    gain: float
    lined: bool
    """Whether the answer is within `NEAR` of the line of the force that is farthest from it."""
    stated: float


def judge(noise: Noise, robot: str, runs: int, seed: int) -> Iterator[Row]:
    """One row for each number of contacts and way of arriving."""
    scene = scene_of(robot, noise)
    oracle = Oracle(scene)
    touches = Toucher(scene, seed=seed).draw(runs, CONTACTS, even=True)
    measured = sequence(touches, noise, seed + 1)
    outcomes: dict[tuple[int, str], list[Outcome]] = {}
    for i in range(runs):
        for way, drift in KNOWN_FORCES.items():
            known: tuple[Contact, ...] = ()
            for step in range(CONTACTS):
                known, outcome = _answer(oracle, touches, measured, i, step, known, drift)
                if step > 0:
                    outcomes.setdefault((step + 1, way), []).append(outcome)
                if not outcome.found:
                    break
        outcome = _answer(oracle, touches, measured, i, 1, (), None)[1]
        outcomes.setdefault((2, "at once"), []).append(outcome)
    for (contacts, arriving), parts in sorted(outcomes.items()):
        yield _row(contacts, arriving, parts)


def _answer(
    oracle: Oracle,
    touches: Touches,
    measured: tuple[np.ndarray, np.ndarray],
    i: int,
    step: int,
    known: tuple[Contact, ...],
    drift: float | None,
) -> tuple[tuple[Contact, ...], Outcome]:
    """Contacts of the answer, and their comparison with the truth."""
    wrench, torque = (part[i, step] for part in measured)
    estimate = oracle.locate(touches.q[i], wrench, torque, step + 1, known, drift)
    contacts = estimate.contacts if estimate.explanations else estimate.contacts[:1]
    truth = touches.point_base[i, : step + 1]
    errors = match(contacts, list(truth))
    found = bool((errors <= NEAR).all())
    if step == 0 or not contacts:
        return contacts, Outcome(found, True, np.inf, False, 0.0)
    at_truth = oracle.from_truth(
        touches.link[i, : step + 1], truth, touches.force_base[i, : step + 1], len(known)
    )
    holds = bool((np.linalg.norm(at_truth.point_base - truth, axis=1) <= NEAR).all())
    worst = int(np.argmax(errors))
    force = touches.force_base[i, worst] / np.linalg.norm(touches.force_base[i, worst])
    offsets = np.array([contact.point_base for contact in contacts]) - truth[worst]
    line_distance = np.linalg.norm(offsets - np.outer(offsets @ force, force), axis=1)
    lined = len(contacts) == len(truth) and bool(line_distance.min() <= NEAR)
    return contacts, Outcome(found, holds, at_truth.gain, lined, estimate.explanations[0].probability)


def _row(contacts: int, arriving: str, outcomes: list[Outcome]) -> Row:
    found, holds = (np.array([getattr(o, name) for o in outcomes], dtype=bool) for name in ("found", "holds"))
    gain = np.array([o.gain if o.holds else -np.inf for o in outcomes])
    missed = ~found
    return Row(
        contacts=contacts,
        arriving=arriving,
        runs=len(outcomes),
        found=float(found.mean()),
        better=float((missed & (gain > TOLERANCE)).mean()),
        alike=float((missed & (abs(gain) <= TOLERANCE)).mean()),
        worse=float((missed & (gain < -TOLERANCE)).mean()),
        perfect=float((found | (holds & (gain >= 0.0))).mean()),
        lined=float((missed & [o.lined for o in outcomes]).mean()),
        stated=float(np.mean([o.stated for o in outcomes])),
    )


@click.command()
@click.option(
    "--robot", "names", multiple=True, default=("ur5e",), help="Arm by name, or a URDF with a surface."
)
@click.option("--runs", default=200, show_default=True, help="Postures with three contacts each.")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the random numbers."
)
@click.option("--json", "as_json", is_flag=True, help="Plain numbers instead of tables.")
def main(names: tuple[str, ...], runs: int, seed: int, as_json: bool) -> None:
    """Compare answers with several contacts with the result of a search that starts at the truth."""
    cases = [(name, noise) for name in names for noise in COLUMNS[:3]]
    rows = [
        (Path(name).stem, noise, row)
        for name, noise in track(cases, "locating", console=Console(stderr=True), transient=True)
        for row in judge(noise, name, runs, seed)
    ]
    if as_json:
        plain = [{"robot": name, "noise": list(noise)} | row._asdict() for name, noise, row in rows]
        click.echo(json.dumps(plain, indent=1))
    else:
        Console(width=128).print(_table(rows))


def _table(rows: list[tuple[str, Noise, Row]]) -> Table:
    table = Table(
        title=f"several contacts of 20 N: is it the search or the measurement? within {1e3 * NEAR:g} mm",
        caption=(
            "runs: in which all contacts before the last were found. Missed: the truth's explanation being "
            "clearly better, about as good (log evidence within 1) or worse than the answer's; on line: with "
            "an answer on the line of the force that was missed. Perfect: no search finds more; stated: mean "
            "probability of the answer"
        ),
    )
    for name in ("arm", "noise N / Nm / Nm", "contacts", "arriving"):
        table.add_column(name, no_wrap=name != "contacts")
    for name in ("runs", "found", "better", "alike", "worse", "on line", "perfect", "stated"):
        table.add_column(name, justify="right")
    for name, noise, row in rows:
        shares = (row.found, row.better, row.alike, row.worse, row.lined, row.perfect, row.stated)
        table.add_row(
            name, str(noise), str(row.contacts), row.arriving, str(row.runs),
            *(f"{100 * share:.1f} %" for share in shares),
        )  # fmt: skip
    return table


if __name__ == "__main__":
    main()
