"""What the joint optimization of several contacts minimizes the energy of."""

from typing import NamedTuple

from contactsense.multi_contact.joint.known_rows import KnownRows
from contactsense.multi_contact.memory.buffers import Measurement
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.solvers.posterior.contact_prior import Prior


class JointProblem(NamedTuple):
    """A measurement and the number of contacts that are to explain it; where these are is in a
    `JointState`."""

    surfaces: Surfaces
    """Primitives, in their body frames."""
    prior: Prior
    """Prior of contacts."""
    measurement: Measurement
    """The measurement, without what is known before of the contacts."""
    known: KnownRows
    """Numbers of known contacts and of their rows, which are in the `JointState`."""
    contacts: int
    """Number of contacts, the known ones first."""
