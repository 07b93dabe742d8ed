"""`contactsense bench map`: the map of what sensors can determine, against simulated pushes and the
localizer."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from contactsense import (
    Batch,
    Detectability,
    JointTorqueSensor,
    Localizer,
    Scene,
    WrenchSensor,
    detectability,
    robots,
)
from contactsense.benchmarks import options
from contactsense.benchmarks.static_truth.cases import COLUMNS, SENSORS, Noise
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.robots import RobotError
from contactsense.scene_model.constants import build_constants
from contactsense.service.cli.options.finite_range import FiniteRange

TOLERANCE = 0.2
"""Relative difference up to which a prediction counts as right."""
PROBABILITY_TOLERANCE = 0.1
"""Difference of probabilities up to which a prediction counts as right."""
WRIST = "wrist"
"""Besides the keys of `SENSORS`: joint torques and a wrist sensor, which measures `ROD`."""
ROD: dict[str, Any] = {
    "name": "rod",
    "mass": 0.5,
    "com": (0.0, 0.0, 0.1),
    "tensor": (1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3),
    "primitives": [{"kind": "capsule", "a": (0.0, 0.0, 0.03), "b": (0.0, 0.0, 0.2), "radius": 0.02}],
}
"""A tool with a surface."""
MULTIPLES = np.linspace(1.0 - TOLERANCE, 1.0 + TOLERANCE, 5)
"""Forces at which detection is simulated, relative to the predicted smallest force."""


class Agreement(NamedTuple):
    """Predictions and simulation at N places; NaN where the map says that the sensors cannot determine
    them."""

    share: np.ndarray
    """Share of each place in the touchable surface, shape (N,)."""
    force_ratio: np.ndarray
    """Simulated over predicted smallest force, shape (N,)."""
    error_ratio: np.ndarray
    """Simulated over predicted median error, shape (N,)."""
    link_difference: np.ndarray
    """Simulated minus predicted probability of naming the link, shape (N,)."""

    def within(self, ratio: np.ndarray) -> float | None:
        """Share of the surface, where the map has a prediction, with a ratio within `TOLERANCE` of 1; None
        where it has none."""
        told = np.isfinite(ratio)
        right = np.abs(ratio[told] - 1.0) <= TOLERANCE
        return float(self.share[told][right].sum() / self.share[told].sum()) if told.any() else None


@click.command(name="map")
@click.option("--robot", "names", multiple=True, default=("ur5e", "ur10e"), help="Arm; may be repeated.")
@click.option(
    "--sensors",
    "measured",
    type=click.Choice((*SENSORS, WRIST)),
    multiple=True,
    default=(*SENSORS, WRIST),
    help="What is measured; may be repeated.  [default: each]",
)
@click.option(
    "--postures", type=click.IntRange(1), default=3, show_default=True, help="Random postures of each arm."
)
@click.option(
    "--draws",
    type=click.IntRange(1),
    default=300,
    show_default=True,
    help="Simulated measurements at each place.",
)
@options.force("Force for errors and link [N].")
@click.option(
    "--friction",
    type=FiniteRange(0.0),
    default=0.0,
    show_default=True,
    help="Coefficient of friction of the pushes.",
)
@click.option(
    "--every", type=click.IntRange(1), default=1, show_default=True, help="Simulate every n-th place only."
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of postures and noise."
)
@options.as_json
def surface_map(
    names: tuple[str, ...],
    measured: tuple[str, ...],
    postures: int,
    draws: int,
    force: float,
    friction: float,
    every: int,
    seed: int,
    as_json: bool,
) -> None:
    """Compare the predictions of `contactsense map` with simulated pushes that the localizer explains.

    Pushes act at every place of the map along the inward normal, and inclined with --friction. The readings
    get the noise of the sensors. Shown is the share of the surface on which the simulated smallest force and
    median error differ by at most 20 % from the prediction, and the same for the probability of naming the
    link with a difference of at most 0.1.
    """
    cases = [(name, noise, sensors) for name in names for noise in COLUMNS[1:] for sensors in measured]
    rows: list[dict[str, Any]] = []
    try:
        for name, noise, sensors in track(cases, console=Console(stderr=True), description="cases"):
            scene = scene_of(name, noise, sensors)
            rng = np.random.default_rng(seed)
            parts = [
                compare(scene, q, force, friction, draws, rng, every)
                for q in random_postures(scene, postures, rng)
            ]
            rows.append({"robot": name, "noise": str(noise), "sensors": sensors} | summary(parts))
    except RobotError as error:
        raise click.ClickException(str(error)) from None
    if as_json:
        click.echo(json.dumps(rows, indent=1))
    else:
        _print(rows)


def scene_of(robot: str, noise: Noise, sensors: str) -> Scene:
    """An arm with that noise and a set of sensors, a key of `SENSORS` or `WRIST`."""
    wrist = sensors == WRIST
    has_base, has_torque = (False, True) if wrist else SENSORS[sensors]
    wrench = WrenchSensor(force_noise=noise.force, moment_noise=noise.moment)
    return Scene.model_validate(
        {
            "robot": robots.load(robot),
            "base_wrench": wrench if has_base else None,
            "joint_torque": JointTorqueSensor(noise=noise.torque) if has_torque else None,
            "wrist_wrench": wrench if wrist else None,
            "tool": ROD if wrist else None,
        }
    )


def random_postures(scene: Scene, count: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Joint positions within the limits, at most one turn [rad]."""
    low, high = np.array([joint.range_within_turn for joint in scene.robot.joints]).T
    for _ in range(count):
        yield rng.uniform(low, high)


def compare(
    scene: Scene,
    q: np.ndarray,
    force: float,
    friction: float,
    draws: int,
    rng: np.random.Generator,
    every: int = 1,
) -> Agreement:
    """Predictions against simulation at all places of one posture.

    Args:
        scene: Sensors and their noise.
        q: Joint positions, shape (n,) [rad].
        force: For errors and probability of the link [N].
        friction: Coefficient of friction of the pushes for these.
        draws: Simulated measurements at each place.
        rng: Source of noise and inclinations.
        every: Only every n-th place is simulated.
    """
    predicted = detectability(scene, q, force=force, friction=friction, every=every)
    simulation = _Simulation(scene, q, predicted, draws, rng)
    answers = simulation.answers(np.full(len(predicted.link), force), friction)
    right = answers.link == predicted.link[:, None]
    distance = np.linalg.norm(answers.point_base - predicted.point_base[:, None], axis=2)
    error = np.array([np.median(d[r]) if r.any() else np.nan for d, r in zip(distance, right, strict=True)])
    told = np.isfinite(predicted.smallest_force)
    reference = np.where(told, predicted.smallest_force, force)
    detected = np.stack(
        [simulation.detected(multiple * reference).mean(axis=1) for multiple in MULTIPLES],
        axis=1,
    )
    found = [
        np.interp(predicted.detection, rising, MULTIPLES, left=np.nan, right=np.nan)
        for rising in np.maximum.accumulate(detected, axis=1)
    ]
    return Agreement(
        share=predicted.share,
        # No crossing within the simulated multiples is a difference of more than 20 %.
        force_ratio=np.where(told, np.nan_to_num(found, nan=0.0), np.nan),
        # Nor does an error agree for which no answer was on the link.
        error_ratio=np.where(
            np.isfinite(predicted.error), np.nan_to_num(error, nan=0.0) / predicted.error, np.nan
        ),
        link_difference=right.mean(axis=1) - predicted.link_probability,
    )


class _Simulation:
    """Noisy readings of pushes at the places of a map, and the localizer's answers."""

    def __init__(
        self, scene: Scene, q: np.ndarray, places: Detectability, draws: int, rng: np.random.Generator
    ) -> None:
        self._scene, self._places, self._rng = scene, places, rng
        self._localizer = Localizer(scene, progress=False)
        # Whether a contact is detected does not depend on where it may be: a search on one link is faster.
        self._detector = Localizer(
            scene.model_copy(update={"touchable": scene.link_names[:1]}), progress=False
        )
        joints = len(scene.robot.joints)
        motion = empty_motion(joints)
        forward_kinematics(build_model(scene.robot), q, motion)
        self._screw = motion.screw
        constants = build_constants(scene)
        self._sensors = constants.sensors
        self._shape = (len(places.link), draws)
        self._q = np.broadcast_to(q, (self._shape[0] * draws, joints)).copy()
        # The same noise at every force, so that detection rises with the force.
        self._base_noise = (
            rng.standard_normal((*self._shape, 6)) @ np.linalg.cholesky(self._sensors.base_covariance).T
        )
        self._torque_noise = rng.standard_normal((*self._shape, joints)) * np.sqrt(
            self._sensors.torque_variance
        )
        self._wrist_noise = np.zeros((*self._shape, 6))
        noise = rng.standard_normal((*self._shape, 2, 3))
        if scene.wrist_wrench is not None:
            wrist = motion.origin[-1] + motion.rotation[-1] @ constants.link_sensors.origin[-1]
            noise *= np.sqrt(self._sensors.link_variance[-1])[:, None]
            # The sensor's moment is about its own origin.
            noise[..., 1, :] += np.cross(wrist, noise[..., 0, :])
            self._wrist_noise = noise.reshape(*self._shape, 6)

    def answers(self, force: np.ndarray, friction: float) -> Batch:
        """Answers for pushes of a normal force at each place, shape (N,) [N]; leading axes (N, draws)."""
        return self._locate(self._localizer, force, friction)

    def detected(self, force: np.ndarray) -> np.ndarray:
        """Whether pushes along the inward normal are detected, shape (N, draws); `force` as in `answers`."""
        return self._locate(self._detector, force, 0.0).detected

    def _locate(self, localizer: Localizer, force: np.ndarray, friction: float) -> Batch:
        places, scene = self._places, self._scene
        normal = places.normal_base[:, None]
        push = np.broadcast_to(-normal, (*self._shape, 3))
        torsion = np.zeros(self._shape)
        if friction > 0.0:
            across = np.cross(normal, self._rng.standard_normal(push.shape))
            across /= np.linalg.norm(across, axis=2, keepdims=True)
            push = push + friction * np.sqrt(self._rng.random(self._shape))[:, :, None] * across
            torsion = scene.torsion * self._rng.standard_normal(self._shape)
        push = force[:, None, None] * push
        twist = (force[:, None] * torsion)[:, :, None] * normal
        wrench = np.concatenate((push, np.cross(places.point_base[:, None], push) + twist), axis=2)
        proximal = np.arange(len(self._screw)) < self._sensors.depth[places.link][:, None]
        torque = -(wrench @ self._screw.T) * proximal[:, None] + self._torque_noise
        base = wrench + self._base_noise
        wrist = self._wrist_noise
        if scene.wrist_wrench is not None:
            wrist = wrist + wrench * (places.link >= self._sensors.first_link[-1])[:, None, None]
        batch = localizer.locate_batch(
            self._q,
            base_wrench=base.reshape(-1, 6) if scene.base_wrench is not None else None,
            joint_torque=torque.reshape(len(self._q), -1) if scene.joint_torque is not None else None,
            wrist_wrench=wrist.reshape(-1, 6) if scene.wrist_wrench is not None else None,
            detect=False,
        )
        return Batch(*(values.reshape(*self._shape, *values.shape[1:]) for values in batch))


def summary(parts: list[Agreement]) -> dict[str, Any]:
    """Agreement over several postures; shares of the surface where the map has a prediction."""
    joined = Agreement(*(np.concatenate(values) for values in zip(*parts, strict=True)))
    told = np.isfinite(joined.error_ratio)
    weight = joined.share / joined.share.sum()
    quantiles = np.quantile(joined.error_ratio[told], (0.05, 0.5, 0.95)).tolist() if told.any() else None
    return {
        "force_within": joined.within(joined.force_ratio),
        "error_told": float(weight[told].sum()),
        "error_within": joined.within(joined.error_ratio),
        "error_ratio": quantiles,
        "link_within": float(weight[np.abs(joined.link_difference) <= PROBABILITY_TOLERANCE].sum()),
        "link_difference": float(weight @ np.abs(joined.link_difference)),
    }


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("arm", "noise", "sensors"):
        table.add_column(heading, no_wrap=True)
    for heading in ("force %", "error %", "predicted %", "named %", "named"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            row["robot"],
            row["noise"],
            row["sensors"],
            *(
                "-" if row[key] is None else f"{100 * row[key]:.0f}"
                for key in ("force_within", "error_within")
            ),
            f"{100 * row['error_told']:.0f}",
            f"{100 * row['link_within']:.0f}",
            f"{row['link_difference']:.3f}",
        )
    Console().print(table)
    click.echo(
        "force, error: surface on which simulation and map differ by at most 20 %\n"
        "predicted: surface on which the map predicts an error\n"
        "named: surface on which the probabilities of naming the link differ by at most 0.1, and their mean "
        "difference\n"
        "wrist: joint torques and a wrist sensor, with a tool"
    )
