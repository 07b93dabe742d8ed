"""Constructed estimates."""

from dataclasses import replace

import numpy as np

from contactsense import Contact, Estimate, Sample, Scene
from contactsense.types import Status

SCENE = Scene.model_validate({"robot": "ur5e"})
LINKS = SCENE.link_names
SIGMA = 1.0
"""Standard deviation of the force [N]."""


def contact(
    link: str = "forearm", newtons: float = 20.0, probability: float = 1.0, **more: object
) -> Contact:
    base = Contact(
        link, LINKS.index(link), 0, probability, np.array([0.1, 0.0, 0.0]), np.array([0.5, 0.0, 0.4]),
        np.array([0.0, 1.0, 0.0]), np.array([0.0, -newtons, 0.0]), 0.0, 1e-4 * np.eye(3), 1, "hold",
    )  # fmt: skip
    return replace(base, **more)  # type: ignore[arg-type]


def estimate(
    t: float, *contacts: Contact, status: Status | None = None, other: float = 0.0, unexplained: float = 0.0
) -> Estimate:
    wrench = np.zeros(6)
    wrench[:3] = contacts[0].force_base if contacts else [0.0, 0.0, unexplained]
    chosen: Status = status or ("contact" if contacts else "none")
    return Estimate(t, chosen, contacts, np.zeros(7), wrench, SIGMA**2 * np.eye(6), other)


def sample(t: float, speed: float = 0.0, q: np.ndarray | None = None) -> Sample:
    return Sample(t, np.zeros(6) if q is None else q, np.full(6, speed))
