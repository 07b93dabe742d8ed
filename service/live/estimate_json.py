"""Estimates as JSON in the form of `contactsense.service.api.messages.EstimateOut`, 500 times a second."""

import json
import math
from typing import Any

import numpy as np

from contactsense.types import Contact, Estimate


def estimate_dict(estimate: Estimate) -> dict[str, Any]:
    """Fields of `EstimateOut` without events; all values are finite or null."""
    return {
        "t": estimate.t,
        "status": estimate.status,
        "contacts": [_contact_dict(contact) for contact in estimate.contacts],
        "link_probability": estimate.link_probability.tolist(),
        "other": estimate.other,
        "wrench": _finite(estimate.wrench),
        "covariance": _finite(estimate.covariance),
        "detectable": estimate.detectable if math.isfinite(estimate.detectable) else None,
        "reason": estimate.reason,
        "events": [],
    }


def estimate_json(estimate: Estimate, q: np.ndarray | None = None) -> bytes:
    """An estimate as JSON in the form of `EstimateOut`; used on the 500 Hz path, hence without validation.
    With `q`: the joint positions of its sample, shape (n,) [rad].

    It ends with an empty list of events: `contactsense.service.live.hub.with_events` inserts them after the
    journal has numbered them. JSON has no NaN. An estimate with NaN where a number is required would be a
    defect of the localizer; it is replaced by a `degraded` estimate with the reason, and the stream
    continues.
    """
    fields = estimate_dict(estimate)
    if q is not None:
        fields |= {"q": _finite(q), "events": fields.pop("events")}
    try:
        return _encoded(fields)
    except ValueError:
        return _encoded(
            fields
            | {
                "t": estimate.t if math.isfinite(estimate.t) else 0.0,
                "status": "degraded",
                "contacts": [],
                "link_probability": [0.0] * len(estimate.link_probability),
                "other": 0.0,
                "reason": "the estimate is not finite; please report this",
            }
        )


def _encoded(fields: dict[str, Any]) -> bytes:
    return json.dumps(fields, allow_nan=False, separators=(",", ":")).encode()


def _contact_dict(contact: Contact) -> dict[str, Any]:
    return {
        "link": contact.link,
        "link_index": contact.link_index,
        "primitive": contact.primitive,
        "probability": contact.probability,
        "point": contact.point.tolist(),
        "point_base": contact.point_base.tolist(),
        "normal_base": contact.normal_base.tolist(),
        "force_base": contact.force_base.tolist(),
        "torsion": contact.torsion,
        "covariance": _finite(contact.covariance),
        "id": contact.id,
        "phase": contact.phase,
        "body": contact.body,
    }


def _finite(array: np.ndarray) -> Any:
    """Convert an array to nested lists; infinity and NaN, which JSON does not have, become null."""
    if np.isfinite(array).all():
        return array.tolist()
    return _null(array.tolist())


def _null(value: Any) -> Any:
    if isinstance(value, list):
        return [_null(item) for item in value]
    return value if math.isfinite(value) else None
