"""`python -m contactsense.benchmarks.accuracy.own_truth FOLDER`: generates our own ground truth, in the
format of the given one.

It allows tuning without the given contacts: other postures, contacts on the primitives, dynamics of our own
model. It has the same model errors as the estimator and does not test them. A point may be touched here with
5 mm of clearance to a neighbouring link, instead of 20 mm.
"""

from pathlib import Path

import click
import numpy as np

from contactsense import Scene, robots
from contactsense.benchmarks.accuracy.static_points import StaticPoints
from contactsense.benchmarks.peers.cases import ROBOTS, weight
from contactsense.benchmarks.posterior.samples import ANGLES, SPACING, Samples, of_primitives
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, build_model, empty_motion

FRICTION = 0.5
TORSION = 0.005
"""Maximum ratio of torsion to normal force [m]."""
FORCES = (5.0, 60.0)
"""Range of normal forces, log-uniform [N]."""


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option("--robot", "names", multiple=True, default=ROBOTS, help="Arm; may be repeated.")
@click.option("--contacts", default=2000, show_default=True, help="Contacts of each arm.")
@click.option("--spacing", default=SPACING, show_default=True, help="Of the places to choose from [m].")
@click.option("--seed", default=1, show_default=True, help="Of postures, places, forces and noise.")
def main(folder: Path, names: tuple[str, ...], contacts: int, spacing: float, seed: int) -> None:
    """Write static_points_ROBOT.npz into FOLDER, which `contactsense bench truth`, `bench calibration` and
    `python -m contactsense.benchmarks.posterior --truth` read."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        points = make(name, contacts, seed, of_primitives(Scene(robot=name), spacing, seed))
        np.savez(
            folder / f"static_points_{name}.npz",
            q=points.q,
            tau=points.torque,
            base_wrench=points.base_wrench,
            link=points.link.astype(np.int8),
            c_base=points.point_base,
            noise_tau=points.noise_torque,
            noise_wrench=points.noise_wrench,
            gravity=[0.0, 0.0, -points.gravity],
        )


def make(robot: str, contacts: int, seed: int, samples: Samples) -> StaticPoints:
    """Contacts uniform by area over the accessible primitives in each posture.

    Args:
        robot: Name of an arm.
        contacts: Number of contacts.
        seed: Seed of the random numbers.
        samples: Samples of the arm's primitives.
    """
    rng = np.random.default_rng(seed)
    scene = Scene(robot=robot)
    model = build_model(robots.load(robot))
    motion = empty_motion(model.joints)
    low, high = np.array([joint.position_limits for joint in scene.robot.joints]).T
    q = rng.uniform(low, high, size=(contacts, model.joints))
    link, point = np.zeros(contacts, dtype=np.int64), np.zeros((contacts, 3))
    wrench, torque = np.zeros((contacts, 6)), np.zeros((contacts, model.joints))
    for i in range(contacts):
        forward_kinematics(model, q[i], motion)
        link[i], point[i], wrench[i] = _contact(samples, q[i], motion, i % 2 == 1, rng)
        torque[i, : link[i]] = -motion.screw[: link[i]] @ wrench[i]
    noise = rng.standard_normal((contacts, model.joints + 6))
    points = StaticPoints(
        robot=robot,
        gravity=scene.gravity,
        q=q,
        torque=torque,
        base_wrench=wrench,
        link=link,
        point_base=point,
        noise_torque=noise[:, 6:],
        noise_wrench=noise[:, :6],
    )
    own_wrench, own_torque = weight(points)
    wrench += own_wrench
    torque += own_torque
    return points


def _contact(
    samples: Samples, q: np.ndarray, motion: Motion, twisted: bool, rng: np.random.Generator
) -> tuple[int, np.ndarray, np.ndarray]:
    """Link, place and wrench about the base origin of one random contact."""
    s, link = _touched(samples, q, motion, rng)
    R, o = motion.rotation[link], motion.origin[link]
    point, normal = o + R @ samples.point[s], R @ samples.normal[s]
    push = np.exp(rng.uniform(*np.log(FORCES)))
    across = rng.normal(size=3)
    across -= (across @ normal) * normal
    across *= FRICTION * np.sqrt(rng.random()) / np.linalg.norm(across)
    force = push * (across - normal)
    torsion = rng.uniform(-TORSION, TORSION) * push if twisted else 0.0
    return link, point, np.concatenate((force, np.cross(point, force) + torsion * normal))


def _touched(samples: Samples, q: np.ndarray, motion: Motion, rng: np.random.Generator) -> tuple[int, int]:
    """A random patch, weighted by area, that can be touched at this posture, and its link."""
    angle = np.floor((q + np.pi) / (2.0 * np.pi) % 1.0 * ANGLES).astype(int)
    while True:
        s = int(rng.choice(len(samples.area), p=samples.area / samples.area.sum()))
        link = int(np.searchsorted(samples.start, s, side="right")) - 1
        if link > 0 and samples.covered[s, 0, angle[link - 1]]:
            continue
        if link < len(q) and samples.covered[s, 1, angle[link]]:
            continue
        # Not below the plane on which the arm is mounted.
        if (motion.origin[link] + motion.rotation[link] @ samples.point[s])[2] > 0.004:
            return s, link


if __name__ == "__main__":
    main()
