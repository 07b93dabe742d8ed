"""Columns that both suites have: what touches the arm, in both frames, and what its sensors read."""

from typing import NamedTuple

import mujoco
import numpy as np

from . import arrays, sensors, simulation


class Touched(NamedTuple):
    """Up to K contacts at a time on N samples; vectors of shape (N, K, 3) in the frames of their links."""

    link: np.ndarray
    """Touched links, -1 for no contact, shape (N, K)."""
    point: np.ndarray
    """[m]"""
    normal: np.ndarray
    """Outward unit normals."""
    force: np.ndarray
    """On the robot [N]."""
    torsion: np.ndarray
    """About the normals, on the robot, float32, shape (N, K) [Nm]."""


def contact_columns(
    model: mujoco.MjModel, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, touched: Touched
) -> dict[str, np.ndarray]:
    """Contacts in link and base axes, and the readings that they cause; zero where nothing touches.

    Args:
        model: Of `simulation.dynamics`.
        q, qd, qdd: Positions, speeds, accelerations of the joints, shape (N, n) each [rad, rad/s, rad/s^2].
        touched: What touches the arm.

    Returns:
        Arrays by their names in docs/ground_truth.md; those of contacts have the shape (N, K) or (N, K, 3).
    """
    origins, rotations = simulation.poses(model, q)
    rows = np.arange(len(q))[:, None]
    origin, rotation = origins[rows, touched.link], rotations[rows, touched.link]
    vectors = np.stack((touched.point, touched.normal, touched.force))
    point, normal, force = np.einsum("nkij,vnkj->vnki", rotation, vectors)
    there = touched.link[..., None] >= 0
    point = np.where(there, origin + point, 0.0)
    force = arrays.on_grid(force, arrays.FORCE)
    moment = touched.torsion[..., None].astype(np.float64) * normal
    readings = sensors.read(model, q, qd, qdd, sensors.Contacts(touched.link, point, force, moment))
    return {
        "tau": arrays.on_grid(readings.torque, arrays.READING),
        "base_wrench": arrays.on_grid(readings.base_wrench, arrays.READING),
        "link": touched.link.astype(np.int8),
        "c_base": point,
        "c_link": touched.point,
        "n_base": normal.astype(np.float32),
        "n_link": touched.normal.astype(np.float32),
        "f": force,
        "xi": touched.torsion,
    }
