"""`POST /v1/locate`: locates the contact for static samples in the request."""

from collections.abc import Sequence

import numpy as np
from fastapi import APIRouter, Response
from starlette.exceptions import HTTPException

from contactsense import Scene
from contactsense.sensors.link_values import by_field
from contactsense.service.api import messages
from contactsense.service.api.http.errors import BODY_REFUSALS, FieldRefusedError
from contactsense.service.api.http.json_route import JsonRoute
from contactsense.service.api.messages import ErrorOut, EstimateOut, EstimatesOut, LocateIn
from contactsense.service.api.service import Shared
from contactsense.service.live.locate_process import LocateError

PUSH = {
    "q": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
    "base_wrench": [5.88, 2.35, -18.97, -1.13, -2.26, -0.63],
    "joint_torque": [0.63, -3.22, -3.47, 0.0, 0.0, 0.0],
}
EXAMPLES = {
    "one": {"summary": "A UR5e whose forearm is pushed with 20 N", "value": PUSH},
    "several": {"summary": "Several samples", "value": {"samples": [PUSH, PUSH], "external": True}},
}
"""Requests in the description. Those that are made from the fields have a single joint, which no arm has."""

router = APIRouter(route_class=JsonRoute)


@router.post(
    "/v1/locate",
    summary="Locate contacts in samples of an arm at rest",
    response_model=EstimateOut | EstimatesOut,
    openapi_extra={"requestBody": {"content": {"application/json": {"examples": EXAMPLES}}}},
    responses={
        **BODY_REFUSALS,
        503: {"model": ErrorOut, "description": "Too many requests wait already: try again later."},
    },
)
async def locate(service: Shared, request: LocateIn) -> Response:
    """Locate the contact for one static sample, or for each of several (`{"samples": [...]}`); several
    simultaneous contacts if `contacts` permits them.

    Needs no robot: the request contains the samples. The response to one sample is an `EstimateOut`, to
    several an `EstimatesOut`.
    """
    many = isinstance(request, messages.LocateManyIn)
    samples: Sequence[messages.SampleIn] = (
        request.samples if isinstance(request, messages.LocateManyIn) else [request]
    )
    for index, sample in enumerate(samples):
        prefix = f"samples[{index}]." if many else ""
        _check(sample, service.scene, prefix)
        base, torque = (
            None if value is None else np.array(value) for value in (sample.base_wrench, sample.joint_torque)
        )
        given = by_field(sample.wrist_wrench, sample.link_wrenches)
        links = {field: np.array(value) for field, value in given.items()}
        found = service.plausible.request(np.array(sample.q), base, torque, links, request.external)
        if found is not None:
            raise FieldRefusedError(prefix + found.field, found.reason)
    most = service.scene.contacts
    if request.contacts > most:
        raise FieldRefusedError(
            "contacts", f"expected at most {most}, as the scene states, got {request.contacts}"
        )
    try:
        encoded = await service.locate(samples, request.external, request.contacts)
    except LocateError as error:
        raise HTTPException(503, str(error), {"Retry-After": "1"}) from None
    body = b'{"estimates":[' + b",".join(encoded) + b"]}" if many else encoded[0]
    return Response(body, media_type="application/json")


def _check(sample: messages.SampleIn, here: Scene, prefix: str) -> None:
    n = len(here.robot.joints)
    for name in ("q", "joint_torque"):
        value = getattr(sample, name)
        if value is not None and len(value) != n:
            raise FieldRefusedError(
                prefix + name, f"expected {n} numbers, one per joint of {here.robot.name}, got {len(value)}"
            )
    absent = [
        name
        for name in ("base_wrench", "joint_torque")
        if getattr(sample, name) is not None and getattr(here, name) is None
    ]
    given = by_field(sample.wrist_wrench, sample.link_wrenches)
    absent += [field for field in given if field not in here.link_sensors]
    for name in absent:
        raise FieldRefusedError(
            prefix + name, f"the scene has no such sensor; leave it out or add {name} to the scene"
        )
    if sample.base_wrench is None and sample.joint_torque is None:
        raise FieldRefusedError(
            prefix + "base_wrench", "expected base_wrench or joint_torque or both, got neither"
        )
