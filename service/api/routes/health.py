"""Routes for the state of the service: for people, load balancers and Prometheus."""

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse

from contactsense.service.api import messages
from contactsense.service.api.messages import ErrorOut, HealthOut
from contactsense.service.api.metrics import CONTENT_TYPE
from contactsense.service.api.service import Shared

router = APIRouter()


@router.get("/v1/health", summary="Health of the service")
async def health(service: Shared) -> HealthOut:
    """State of the service, its pipeline, its sensors and its readers; 200 while the service runs."""
    return service.health()


@router.get(
    "/v1/ready",
    summary="Whether estimates are current",
    responses={503: {"model": messages.ReadyOut | ErrorOut, "description": "They are not: the reasons."}},
)
async def ready(service: Shared, response: Response) -> messages.ReadyOut:
    """Whether estimates are current: 200, or 503 with the reasons. Needs no token."""
    if not service.ready:
        response.status_code = 503
    return messages.ReadyOut(
        ready=service.ready, status=service.runner.status, reasons=list(service.runner.reasons)
    )


@router.get("/metrics", summary="Metrics for Prometheus", response_class=PlainTextResponse)
async def metrics(service: Shared) -> Response:
    """All counters, ages and times in Prometheus' text format."""
    return Response(service.metrics.text(), media_type=CONTENT_TYPE)
