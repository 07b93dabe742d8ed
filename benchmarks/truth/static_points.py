"""One contact per sample on an arm at rest, in random postures, on random points of the visual meshes."""

from collections.abc import Callable

import numpy as np

from . import arrays, simulation
from .arm import Arm
from .columns import Touched, contact_columns
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

    # One contact at a time.
    drawn = (link, point_link, normal_link, push[:, None] * (across - normal_link), torsion)
    rest = np.zeros_like(q)
    columns = contact_columns(
        simulation.dynamics(arm), q, rest, rest, Touched(*(column[:, None] for column in drawn))
    )
    readings = {name: columns.pop(name) for name in ("tau", "base_wrench")}
    run = np.arange(contacts) // _BIASED
    return {
        "q": q,
        **readings,
        **{name: column[:, 0] for name, column in columns.items()},
        "fn": push.astype(np.float32),
        "run": run.astype(np.int16),
        **arrays.noise(rng, contacts, int(run[-1]) + 1, len(arm.speeds)),
        "gravity": np.array(simulation.GRAVITY),
        "meta": arrays.described(arm, "static_points", seed),
    }


def _exposed_place(surface: Surface, exposure: Exposure, rng: np.random.Generator) -> Place:
    """A random place, uniform by area over the exposed part of the arm in its posture."""
    while True:
        place = surface.draw(rng)
        if exposure.exposed(place.link, place.point, place.normal):
            return place
