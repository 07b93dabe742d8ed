"""One contact per sample on an arm at rest, in random postures, on random points of the visual meshes."""

from collections.abc import Callable

import numpy as np

from . import arrays, sensors, simulation
from .arm import Arm
from .exposure import Exposure
from .postures import Postures
from .pushes import normal_force, tangential, torsion_ratio
from .surface import Place, Surface

_BIASED = 50
"""Samples that share a bias."""


def make(
    arm: Arm, contacts: int, seed: int, step: Callable[[], None] = lambda: None
) -> dict[str, np.ndarray]:
    """Arrays of `static_points_ROBOT.npz`; shapes, frames and units are those of docs/ground_truth.md.

    Args:
        arm: The arm.
        contacts: Number of samples N, at least 1.
        seed: The same seed gives the same arrays.
        step: Called after each contact.
    """
    rng = np.random.default_rng((seed, 0))
    postures, exposure, surface = Postures(arm), Exposure(arm), Surface(arm.links)
    q, places = np.empty((contacts, len(arm.speeds))), []
    for i in range(contacts):
        q[i] = arrays.on_grid(postures.draw(rng), arrays.POSITION)
        exposure.place(q[i])
        places.append(_exposed_place(surface, exposure, rng))
        step()
    normal_link = np.array([place.normal for place in places])
    point_link = arrays.on_grid(np.array([place.point for place in places]), arrays.LENGTH)
    link = np.array([place.link for place in places])
    push = np.array([normal_force(rng) for _ in places])
    across = np.array([tangential(rng, normal) for normal in normal_link])
    torsion = np.array([torsion_ratio(rng) for _ in places]) * push
    torsion[::2] = 0.0
    torsion = torsion.astype(np.float32)

    model, rows = simulation.dynamics(arm), np.arange(contacts)
    origins, rotations = simulation.poses(model, q)
    origin, rotation = origins[rows, link], rotations[rows, link]
    point = origin + np.einsum("nij,nj->ni", rotation, point_link)
    normal = np.einsum("nij,nj->ni", rotation, normal_link)
    force = arrays.on_grid(
        np.einsum("nij,nj->ni", rotation, push[:, None] * (across - normal_link)), arrays.FORCE
    )
    rest = np.zeros_like(q)
    moment = torsion[:, None].astype(np.float64) * normal
    touched = sensors.Contacts(link[:, None], point[:, None], force[:, None], moment[:, None])
    readings = sensors.read(model, q, rest, rest, touched)
    run = rows // _BIASED
    return {
        "q": q,
        "tau": arrays.on_grid(readings.torque, arrays.READING),
        "base_wrench": arrays.on_grid(readings.base_wrench, arrays.READING),
        "link": link.astype(np.int8),
        "c_base": point,
        "c_link": point_link,
        "n_base": normal.astype(np.float32),
        "n_link": normal_link.astype(np.float32),
        "f": force,
        "xi": torsion,
        "fn": push.astype(np.float32),
        "run": run.astype(np.int16),
        **arrays.noise(rng, contacts, int(run[-1]) + 1),
        "gravity": np.array(simulation.GRAVITY),
        "meta": arrays.described(arm, "static_points", seed),
    }


def _exposed_place(surface: Surface, exposure: Exposure, rng: np.random.Generator) -> Place:
    """A random place, uniform by area over the exposed part of the arm in its posture."""
    while True:
        place = surface.draw(rng)
        if exposure.exposed(place.link, place.point, place.normal):
            return place
