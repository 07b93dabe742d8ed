"""The searches on blocks of primitives, for one primitive."""

import numpy as np

from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.surface.convex_primitives import bounding_radius
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior.block import GAP
from contactsense.solvers.posterior.contact_prior import Contact, Prior, SearchBuffers
from contactsense.solvers.posterior.line_of_action import enter_surfaces
from contactsense.solvers.posterior.mode import Mode, find_posterior_mode
from contactsense.solvers.posterior.simd import contact_of, load_primitive, load_wrench
from contactsense.solvers.wrench import Wrench

FIRST = np.zeros(1, dtype=np.int64)


def enter_surface(kind: int, size: np.ndarray, wrench: Wrench) -> tuple[float, Vector, Vector]:
    """Distance between the line of action of a wrench and a primitive, 0 if it enters; point and normal
    there, body frame."""
    block = zeros(SearchBuffers).block
    load_primitive(0, kind, size, bounding_radius(kind, size), block)
    load_wrench(0, np.concatenate(wrench), np.eye(6), block)
    enter_surfaces(np.array([kind]), size[None], FIRST, block)
    found = contact_of(0, block)
    return float(block[GAP]), found.point, found.normal


def posterior_mode(
    kind: int, size: np.ndarray, w: np.ndarray, L: np.ndarray, prior: Prior, start: Contact
) -> Mode:
    """`find_posterior_mode` of one primitive."""
    block = zeros(SearchBuffers).block
    found: Mode = find_posterior_mode(np.array([kind]), size[None], FIRST, w, L, prior, start, block)
    return found
