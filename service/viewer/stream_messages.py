"""The service's messages as the types that are drawn."""

import numpy as np

from contactsense.service.api.messages import ContactOut, EstimateOut
from contactsense.types import Contact, Estimate


def estimate_of(message: EstimateOut) -> Estimate:
    """The estimate in a message, without its events; what is null there is infinite here."""
    return Estimate(
        t=message.t,
        status=message.status,
        contacts=tuple(_contact(contact) for contact in message.contacts),
        link_probability=np.array(message.link_probability),
        wrench=_bounded(message.wrench),
        covariance=_bounded(message.covariance),
        detectable=np.inf if message.detectable is None else message.detectable,
        other=message.other,
        reason=message.reason,
    )


def joints_of(message: EstimateOut, joints: int) -> np.ndarray | None:
    """Joint positions in a message, shape (joints,) [rad]; None where they are not known."""
    if message.q is None or len(message.q) != joints or None in message.q:
        return None
    return np.array(message.q, dtype=float)


def _contact(message: ContactOut) -> Contact:
    return Contact(
        link=message.link,
        link_index=message.link_index,
        primitive=message.primitive,
        probability=message.probability,
        point=np.array(message.point),
        point_base=np.array(message.point_base),
        normal_base=np.array(message.normal_base),
        force_base=np.array(message.force_base),
        torsion=message.torsion,
        covariance=_bounded(message.covariance),
        id=message.id,
        phase=message.phase,
    )


def _bounded(numbers: object) -> np.ndarray:
    array = np.array(numbers, dtype=float)  # None becomes NaN
    return np.where(np.isnan(array), np.inf, array)
