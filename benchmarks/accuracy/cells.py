"""`contactsense bench cells SCENE...`: what the sensors of a scene can determine, on simulated contacts."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from contactsense import Estimate, Localizer, Scene
from contactsense.benchmarks import options
from contactsense.benchmarks.peers.touches import Toucher, Touches
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.residuals.joint_friction import unmodelled_torque_std
from contactsense.scene import SceneError
from contactsense.scene_model.constants import Constants, build_constants


class Answers(NamedTuple):
    """Answers for N contacts, each measured once."""

    detected: np.ndarray
    """Whether the measurement stands out from noise at the scene's false alarms, shape (N,), bool."""
    named: np.ndarray
    """Whether the most probable candidate is on the touched link, shape (N,), bool."""
    listed: np.ndarray
    """Whether some candidate is, shape (N,), bool."""
    clear: np.ndarray
    """Whether the estimate is a clear `contact`, shape (N,), bool."""
    error: np.ndarray
    """Distance of the best candidate from the contact, infinite without one, shape (N,) [m]."""


def measure(scene: Scene, contacts: int, force: float, seed: int) -> tuple[Touches, Answers]:
    """Draw contacts on the touchable links, all equally probable, and locate each from one noisy sample.

    Args:
        scene: Its sensors and their noise; the arm is at rest, its joints held by friction.
        contacts: Number of contacts, each in a posture of its own.
        force: Magnitude of each force [N].
        seed: Of everything random.
    """
    constants, localizer = build_constants(scene), Localizer(scene)
    touches = Toucher(scene, seed=seed).draw(contacts, force=force, even=True)
    rng = np.random.default_rng(seed + 1)
    estimates = [_locate(scene, constants, localizer, touches, i, rng) for i in range(contacts)]
    link = touches.link[:, 0]
    best = [estimate.contacts[0] if estimate.contacts else None for estimate in estimates]
    return touches, Answers(
        detected=np.array([estimate.status != "none" for estimate in estimates]),
        named=np.array([c is not None and c.link_index == k for c, k in zip(best, link, strict=True)]),
        listed=np.array(
            [any(c.link_index == k for c in e.contacts) for e, k in zip(estimates, link, strict=True)]
        ),
        clear=np.array([estimate.status == "contact" for estimate in estimates]),
        error=np.array(
            [
                np.inf if c is None else np.linalg.norm(c.point_base - point)
                for c, point in zip(best, touches.point_base[:, 0], strict=True)
            ]
        ),
    )


def _locate(
    scene: Scene,
    constants: Constants,
    localizer: Localizer,
    touches: Touches,
    i: int,
    rng: np.random.Generator,
) -> Estimate:
    q, wrench = touches.q[i], touches.base_wrench[i, 0]
    joints, sensors = len(q), constants.sensors
    base_wrench = joint_torque = wrist_wrench = None
    if scene.base_wrench is not None:
        base_wrench = wrench + rng.multivariate_normal(np.zeros(6), sensors.base_covariance)
    if scene.joint_torque is not None:
        model = [unmodelled_torque_std(constants.torque_model, j, 0.0) for j in range(joints)]
        deviation = np.sqrt(sensors.torque_variance + np.square(model))
        joint_torque = touches.joint_torque[i, 0] + deviation * rng.standard_normal(joints)
    if scene.wrist_wrench is not None:
        beyond = bool(touches.link[i, 0] >= sensors.first_link[-1])
        wrist_wrench = wrench * beyond + _wrist_noise(constants, q, rng)
    return localizer.locate(q, base_wrench=base_wrench, joint_torque=joint_torque, wrist_wrench=wrist_wrench)


def _wrist_noise(constants: Constants, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Noise of the wrist sensor in base axes, about the base origin, shape (6,) [N, Nm]."""
    motion = empty_motion(len(q))
    forward_kinematics(constants.model, q, motion)
    origin = motion.origin[-1] + motion.rotation[-1] @ constants.link_sensors.origin[-1]
    force, moment = np.sqrt(constants.sensors.link_variance[-1])[:, None] * rng.standard_normal((2, 3))
    return np.concatenate((force, moment + np.cross(origin, force)))


@click.command()
@click.argument("scenes", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--contacts",
    type=click.IntRange(1),
    default=700,
    show_default=True,
    help="Contacts, each in a posture of its own.",
)
@options.force("Magnitude of each force [N].")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the random numbers."
)
@options.as_json
def cells(scenes: tuple[Path, ...], contacts: int, force: float, seed: int, as_json: bool) -> None:
    """Measure what the sensors of each of SCENES can determine of a contact, by touched link."""
    try:
        loaded = {path.stem: Scene.load(path) for path in scenes}
    except SceneError as error:
        raise click.ClickException(str(error)) from None
    plain: dict[str, Any] = {}
    for name, scene in loaded.items():
        with Console(stderr=True).status(f"{name}: locating"):
            touches, answers = measure(scene, contacts, force, seed)
        link = touches.link[:, 0]
        groups = {scene.link_names[k]: link == k for k in np.unique(link)} | {"all": link >= 0}
        rows = {group: _summary(Answers(*(part[own] for part in answers))) for group, own in groups.items()}
        plain[name] = rows
        if not as_json:
            Console(width=100).print(_table(f"{name}: one sample of {force:g} N", rows))
    if as_json:
        click.echo(json.dumps(plain, indent=1))


def _summary(answers: Answers) -> dict[str, float | None]:
    clear = answers.error[answers.clear]
    return {
        "contacts": len(answers.named),
        "detected": float(answers.detected.mean()),
        "named": float(answers.named.mean()),
        "listed": float(answers.listed.mean()),
        "clear": float(answers.clear.mean()),
        "median": _finite(np.median(answers.error)),
        "clear_median": _finite(np.median(clear)) if len(clear) else None,
        "clear_p95": _finite(np.quantile(clear, 0.95)) if len(clear) else None,
    }


def _finite(value: np.floating[Any]) -> float | None:
    return float(value) if np.isfinite(value) else None


def _table(title: str, rows: dict[str, dict[str, float | None]]) -> Table:
    table = Table(title=title)
    table.add_column("touched link", no_wrap=True)
    headings = (
        "contacts", "detected", "link right", "listed", "clear", "median mm", "clear: median mm", "95 % mm",
    )  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="right")
    for name, row in rows.items():
        shares = (row[key] for key in ("detected", "named", "listed", "clear"))
        lengths = (row[key] for key in ("median", "clear_median", "clear_p95"))
        table.add_row(
            name,
            str(row["contacts"]),
            *(f"{100 * share:.0f} %" for share in shares if share is not None),
            *("-" if length is None else f"{1e3 * length:.0f}" for length in lengths),
        )
    return table
