"""Messages: an estimate arrives as it left, and JSON never holds what JSON does not know."""

import json
from dataclasses import replace

import numpy as np
import pytest

from contactsense import Contact, Estimate, Event
from contactsense.service.api.messages import EstimateOut
from contactsense.service.events.model import ContactEvent
from contactsense.service.live.estimate_json import estimate_json
from contactsense.service.live.hub import with_events

CONTACT = Contact(
    link="forearm",
    link_index=3,
    primitive=1,
    probability=0.75,
    point=np.array([0.1, 0.2, 0.3]),
    point_base=np.array([0.4, 0.5, 0.6]),
    normal_base=np.array([0.0, 0.0, 1.0]),
    force_base=np.array([1.0, 2.0, -30.0]),
    torsion=0.05,
    covariance=np.diag([1e-6, 2e-6, 3e-6]),
    id=4,
    phase="slide",
    body="table",
)
ESTIMATE = Estimate(
    t=12.5,
    status="ambiguous",
    contacts=(CONTACT, replace(CONTACT, link="wrist_1", link_index=4, probability=0.25)),
    link_probability=np.array([0, 0, 0, 0.75, 0.25, 0, 0]),
    wrench=np.array([1.0, 2.0, -30.0, 4.0, 5.0, 6.0]),
    covariance=np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    reason="two links explain it",
    events=(Event("slide", 4, 12.5, "forearm"),),
)


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")


def read(estimate: Estimate) -> EstimateOut:
    return EstimateOut.model_validate(json.loads(estimate_json(estimate), parse_constant=refuse))


def test_an_estimate_arrives_as_it_left() -> None:
    read_back = read(ESTIMATE)
    assert (read_back.t, read_back.status, read_back.reason) == (12.5, "ambiguous", "two links explain it")
    assert [contact.link for contact in read_back.contacts] == ["forearm", "wrist_1"]
    assert [(contact.id, contact.phase) for contact in read_back.contacts] == [(4, "slide")] * 2
    assert read_back.events == []
    assert [contact.body for contact in read_back.contacts] == ["table"] * 2
    first = read_back.contacts[0]
    for name in ("point", "point_base", "normal_base", "force_base", "covariance"):
        np.testing.assert_array_equal(getattr(first, name), getattr(CONTACT, name))
    for name in ("link_probability", "wrench", "covariance"):
        np.testing.assert_array_equal(getattr(read_back, name), getattr(ESTIMATE, name))


def test_events_ride_on_an_estimate() -> None:
    event = ContactEvent(id=7, kind="slide", contact=4, t=12.5, link="forearm", force=21.0)
    message = with_events(estimate_json(ESTIMATE), [event.model_dump_json().encode()] * 2)
    assert EstimateOut.model_validate_json(message).events == [event, event]


def test_joint_positions_ride_on_an_estimate_before_its_events() -> None:
    event = ContactEvent(id=7, kind="slide", contact=4, t=12.5, link="forearm", force=21.0)
    message = estimate_json(ESTIMATE, np.array([0.5, np.nan]))
    read_back = EstimateOut.model_validate_json(with_events(message, [event.model_dump_json().encode()]))
    assert (read_back.q, read_back.events) == ([0.5, None], [event])
    assert read(ESTIMATE).q is None


def test_what_is_not_bounded_is_null() -> None:
    unbounded = np.diag([np.inf, 1.0, 1.0, 1.0, 1.0, np.nan])
    read_back = read(
        replace(ESTIMATE, covariance=unbounded, contacts=(replace(CONTACT, covariance=unbounded[:3, :3]),))
    )
    assert read_back.covariance[0][0] is None
    assert read_back.covariance[5][5] is None
    assert read_back.covariance[1][1] == 1.0
    assert read_back.contacts[0].covariance[0][0] is None


@pytest.mark.parametrize(
    "broken",
    [
        replace(ESTIMATE, contacts=(replace(CONTACT, point=np.array([np.nan, 0.0, 0.0])),)),
        replace(ESTIMATE, contacts=(replace(CONTACT, torsion=np.inf),)),
        replace(ESTIMATE, link_probability=np.full(7, np.nan), wrench=np.full(6, np.nan)),
        replace(ESTIMATE, t=np.nan),
        replace(ESTIMATE, other=np.nan, detectable=4.5),
    ],
)
def test_an_estimate_that_is_no_number_is_told_of(broken: Estimate) -> None:
    read_back = read(broken)
    # It has the fields of every other estimate, in their order.
    message = json.loads(estimate_json(broken, np.zeros(6)))
    assert list(message) == list(json.loads(estimate_json(ESTIMATE, np.zeros(6))))
    assert message["other"] == 0.0
    assert message["detectable"] == (broken.detectable if np.isfinite(broken.detectable) else None)
    assert read_back.status == "degraded"
    assert not read_back.contacts
    assert "not finite" in read_back.reason
