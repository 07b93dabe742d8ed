"""Fraction of each link where contacts can be located from joint torques alone, and with a base sensor.

Pang, Umenberger & Tedrake (2021) found 32.6 % of a UR5's forearm fully detectable from torques alone. Their
criterion is uniqueness. Ours is the error of the estimate: it must be within 22.5 mm of the contact.

Run: python -m contactsense.benchmarks.torque_only
"""

from typing import NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import JointTorqueSensor, Scene, WrenchSensor
from contactsense.benchmarks.compare import NEAR
from contactsense.benchmarks.peers.method import Located
from contactsense.benchmarks.peers.touches import Toucher, Touches
from contactsense.benchmarks.static_truth.cases import ASSUMED, COLUMNS, Noise

FORCE = 20.0
"""Magnitude of each force [N]."""


class Shares(NamedTuple):
    """Results per link. Contacts are uniform by area, so fractions of contacts are fractions of area."""

    located: np.ndarray
    """Fraction of the contacts located within `NEAR`, shape (links,)."""
    contacts: np.ndarray
    """Number of contacts, shape (links,)."""


def touched(robot: str, contacts: int, seed: int = 0) -> Touches:
    """One contact in each of many postures, links equally probable, points uniform by area."""
    return Toucher(Scene(robot=robot), seed=seed).draw(contacts, force=FORCE, even=True)


def shares(robot: str, touches: Touches, noise: Noise, base: bool, seed: int = 1) -> Shares:
    """Locate contacts from joint torques, with or without a base sensor."""
    assumed = Noise(*(max(level, floor) for level, floor in zip(noise, ASSUMED, strict=True)))
    scene = Scene(
        robot=robot,
        base_wrench=WrenchSensor(force_noise=assumed.force, moment_noise=assumed.moment) if base else None,
        joint_torque=JointTorqueSensor(noise=assumed.torque),
    )
    contacts = len(touches.q)
    rng = np.random.default_rng(seed)
    wrench = touches.base_wrench[:, 0] + rng.normal(size=(contacts, 6)) * np.repeat(noise[:2], 3)
    torque = touches.joint_torque[:, 0] + rng.normal(size=touches.q.shape) * noise.torque
    found = Located(scene)(touches.q, wrench if base else None, torque)
    near = np.linalg.norm(found.point_base - touches.point_base[:, 0], axis=1) <= NEAR
    link, links = touches.link[:, 0], len(scene.link_names)
    count = np.bincount(link, minlength=links)
    hits = np.bincount(link, weights=near & (found.link >= 0), minlength=links)
    return Shares(hits / np.maximum(count, 1), count)


@click.command()
@click.option("--robot", default="ur5e", show_default=True, help="Arm.")
@click.option("--contacts", default=1400, show_default=True, help="Contacts, each in a posture of its own.")
def main(robot: str, contacts: int) -> None:
    """Share of each link's area where a contact of 20 N is located to 22.5 mm."""
    touches = touched(robot, contacts)
    cases = [(noise, base) for noise in COLUMNS[:3] for base in (False, True)]
    results = [
        shares(robot, touches, noise, base)
        for noise, base in track(cases, "locating", console=Console(stderr=True), transient=True)
    ]
    table = Table(title=f"{robot}: {contacts} contacts of {FORCE:g} N on the primitives; located to 22.5 mm")
    table.add_column("link")
    table.add_column("contacts", justify="right")
    for noise, base in cases:
        table.add_column(f"{noise}\n{'with base' if base else 'torques'}", justify="right")
    for link, name in enumerate(Scene(robot=robot).link_names):
        row = [f"{100 * result.located[link]:.1f} %" for result in results]
        table.add_row(name, str(results[0].contacts[link]), *row)
    Console(width=112).print(table)


if __name__ == "__main__":
    main()
