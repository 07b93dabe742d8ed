"""`contactsense paper`: the results of Bicchi, Salisbury & Brock (1993) compared with ours."""

import json
from typing import Any

import click
import numpy as np

from contactsense.benchmarks.solvers.paper_tables import (
    FORCE_OF_TABLE_3,
    MISPRINTS,
    RADIUS_OF_TABLE_1,
    STEPS_OF_TABLE_2,
    TABLE_1,
    TABLE_2,
    TABLE_3,
)
from contactsense.benchmarks.solvers.speed import table_2
from contactsense.benchmarks.solvers.tables import Table
from contactsense.solvers import Method, Sphere, solve


def four_contacts(
    friction: float, delta: float, radius: float = RADIUS_OF_TABLE_1
) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment, shape (3,), of the paper's figure 8: four contacts on top of a sphere."""
    x = np.array((delta, 0.0, -delta, 0.0))
    y = np.array((0.0, 8.0 * delta, 0.0, -8.0 * delta))
    points = np.column_stack((x, y, np.sqrt(radius**2 - x**2 - y**2)))
    forces = np.array([(-friction, friction, -1.0)] * 2 + [(friction, friction, -1.0)] * 2)
    return forces.sum(axis=0), np.cross(points, forces).sum(axis=0)


def _table_1() -> Table:
    rows, data = [], []
    for (friction, delta), (exact, axis) in TABLE_1.items():
        wrench = four_contacts(friction, delta)
        sphere = Sphere(RADIUS_OF_TABLE_1)
        ours = float(solve(sphere, *wrench).centroid[0])
        line = float(solve(sphere, *wrench, "wrench_axis").centroid[0])
        rows.append((f"{friction}", f"{delta}", f"{exact:.3f}", f"{ours:.4f}", f"{axis:.3f}", f"{line:.4f}"))
        data.append({"friction": friction, "delta": delta, "ellipsoid": ours, "wrench_axis": line})
    head = ("h_f", "delta", "ellipsoid, printed", "ours", "wrench axis, printed", "ours")
    return Table(head, rows, data)


def _table_2() -> Table:
    exact, step, steps = table_2(100_000)
    printed = (
        TABLE_2["ellipsoid"] / TABLE_2["wrench axis"],
        TABLE_2["iterative step"] / TABLE_2["ellipsoid"],
        float(STEPS_OF_TABLE_2),
    )
    names = ("ellipsoid / wrench axis", "one iterative step / ellipsoid", "iterative steps to 1e-6")
    ours = (exact, step, steps)
    rows = [(name, f"{old:.2f}", f"{new:.2f}") for name, old, new in zip(names, printed, ours, strict=True)]
    return Table(("", "printed", "ours"), rows, [dict(zip(names, ours, strict=True))])


def _point(point: Any) -> str:
    return "-" if point is None else "(" + ", ".join(f"{x:.3f}" for x in point) + ")"


def _table_3() -> Table:
    rows = []
    data: list[dict[str, Any]] = []
    methods: tuple[Method, ...] = ("exact", "newton", "descent")
    for moment, (axis, exact, iterative) in TABLE_3.items():
        wrench = (FORCE_OF_TABLE_3, (0.01, 0.01, moment))
        line = solve(Sphere(1.0), *wrench, "wrench_axis")
        found = {method: solve(Sphere(1.0), *wrench, method) for method in methods}
        rows.append(
            (
                f"{moment:.2f}",
                _point(axis),
                _point(line.centroid) if line.ok else line.status.name.lower(),
                _point(exact),
                _point(found["exact"].centroid),
                _point(iterative),
                _point(found["descent"].centroid),
                _point(found["newton"].centroid),
            )
        )
        data.append(
            {"m_3": moment, **{method: solution.centroid.tolist() for method, solution in found.items()}}
        )
    head = (
        "m_3",
        "wrench axis, printed",
        "ours",
        "ellipsoid, printed",
        "ours",
        "iterative, printed",
        "ours: descent",
        "Newton",
    )
    return Table(head, rows, data)


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print our numbers as JSON.")
def paper(as_json: bool) -> None:
    """Reproduce the tables of the paper on which this project is based, and list the misprints of our copy.

    Bicchi, Salisbury & Brock, "Contact Sensing from Force Measurements", 1993.
    """
    made = {
        f"Table 1: x of the centroid of four contacts, radius {RADIUS_OF_TABLE_1:g} (inferred)": _table_1(),
        "Table 2: time, as ratios (the paper's on a Motorola 68030)": _table_2(),
        "Table 3: contact on a unit sphere, f = (-0.3, -0.4, 0.01), m = (0.01, 0.01, m_3)": _table_3(),
    }
    if as_json:
        click.echo(json.dumps({title.partition(":")[0]: table.data for title, table in made.items()}))
        return
    for title, table in made.items():
        notes = "".join(
            f"- printed: {one.printed}; taken: {one.taken}. Reason: {one.reason}.\n"
            for one in MISPRINTS.get(title.partition(":")[0], ())
        )
        click.echo(f"{title}\n\n{table.aligned()}\n" + (f"\n{notes}" if notes else ""))
