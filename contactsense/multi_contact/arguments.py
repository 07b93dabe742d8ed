"""Checks of what `Localizer.locate` is told about several contacts."""

import math
from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np

from contactsense.multi_contact.memory.buffers import MAX_CONTACTS
from contactsense.types import Contact

_FIELDS = (("point_base", (3,)), ("force_base", (3,)), ("torsion", ()), ("covariance", (3, 3)))
"""Fields of a known contact that are used, and their shapes."""
_ROUNDING = 1e-6
"""Rounding error of a covariance that was written to a file, relative to its trace."""


def check_arguments(contacts: int, known: Sequence[Contact], drift: float | None, start: np.ndarray) -> None:
    """Check the arguments of `Localizer.locate`.

    Args:
        contacts, known, drift: As for `Localizer.locate`.
        start: First primitive of each link, and the number of all, shape (links + 1,).

    Raises:
        ValueError: the message names the argument, the expected value and the actual one.
    """
    if not isinstance(contacts, Integral) or not 1 <= contacts <= MAX_CONTACTS:
        raise ValueError(f"contacts: expected 1 to {MAX_CONTACTS}, got {contacts!r}")
    if not isinstance(known, Sequence):
        raise ValueError(f"known: expected a sequence of Contact, got {known!r:.60}")
    if len(known) > contacts:
        raise ValueError(f"known: expected at most {contacts} (contacts), got {len(known)}")
    if drift is not None and not (isinstance(drift, Real) and math.isfinite(drift) and drift > 0.0):
        raise ValueError(f"drift: expected a positive number of N, got {drift!r}")
    for i, contact in enumerate(known):
        if not isinstance(contact, Contact):
            raise ValueError(f"known[{i}]: expected a Contact, got {contact!r:.60}")
        _check_contact(f"known[{i}]", contact, start)


def _check_contact(name: str, contact: Contact, start: np.ndarray) -> None:
    """Refuse a known contact on no surface of the arm, or with numbers that none has."""
    links = len(start) - 1
    if not 0 <= contact.link_index < links:
        raise ValueError(f"{name}.link_index: expected 0 to {links - 1}, got {contact.link_index}")
    count = int(start[contact.link_index + 1] - start[contact.link_index])
    if not 0 <= contact.primitive < count:
        expected = f"0 to {count - 1} on {contact.link}"
        raise ValueError(f"{name}.primitive: expected {expected}, got {contact.primitive}")
    for field, shape in _FIELDS:
        value = getattr(contact, field)
        # The sum is finite if and only if all are, unless they are too large for any contact.
        if np.shape(value) != shape or not math.isfinite(float(np.sum(value))):
            expected = f"finite numbers of shape {shape}" if shape else "a finite number"
            raise ValueError(f"{name}.{field}: expected {expected}, got {value!r}")
    C = np.asarray(contact.covariance)
    rounding = _ROUNDING * abs(float(np.trace(C)))
    if np.abs(C - C.T).max() > rounding or np.linalg.eigvalsh(C)[0] < -rounding:
        raise ValueError(
            f"{name}.covariance: expected a symmetric matrix without negative eigenvalues, "
            f"got {contact.covariance!r}"
        )
