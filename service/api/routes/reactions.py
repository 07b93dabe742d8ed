"""Reactions over HTTP: state, acknowledgement, announcement of expected contacts. Rules cannot be changed."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from contactsense.scene import Scene
from contactsense.service.api.http.errors import BODY_REFUSALS, FieldRefusedError, Responses
from contactsense.service.api.http.json_route import JsonRoute
from contactsense.service.api.messages import ErrorOut
from contactsense.service.api.request_body import RequestBody
from contactsense.service.reactions.health import ReactionsOut
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.reactions.state import Reactions

router = APIRouter(route_class=JsonRoute)
_NOT_POSSIBLE: Responses = {
    503: {"model": ErrorOut, "description": "There are no rules, or no pipeline runs."},
}


class AcknowledgeIn(RequestBody):
    """Which collisions to acknowledge."""

    rule: str | None = Field(
        None,
        description="Name of a rule with a level `collision`; null or left out: all of them.",
        examples=[None],
    )


class ExpectedIn(RequestBody):
    """An expected contact of the rules file."""

    name: str = Field(description="Its name in the rules file.")
    open: bool = Field(True, description="true: open its window, for at most its timeout; false: close it.")


def _reactions(connection: HTTPConnection) -> Reactions:
    reactions: Reactions = connection.app.state.service.reactions
    return reactions


def _scene(connection: HTTPConnection) -> Scene:
    scene: Scene = connection.app.state.service.scene
    return scene


Shared = Annotated[Reactions, Depends(_reactions)]
SharedScene = Annotated[Scene, Depends(_scene)]


@router.get("/v1/reactions", summary="Rules and their state")
async def reactions(shared: Shared, scene: SharedScene) -> ReactionsOut:
    """The rules in words, active levels, latched collisions, open windows, and the state of each action."""
    return shared.out(scene)


@router.post(
    "/v1/reactions/acknowledge",
    summary="Acknowledge collisions",
    responses={**BODY_REFUSALS, **_NOT_POSSIBLE},
)
async def acknowledge(
    shared: Shared, scene: SharedScene, request: AcknowledgeIn | None = None
) -> ReactionsOut:
    """Clear latched collisions. A force that is still above its level latches and starts its actions
    again."""
    rule = None if request is None else request.rule
    latching = [known.name for known in _rules(shared).rules if known.collision is not None]
    if rule is not None and rule not in latching:
        known = f"one of {', '.join(latching)}" if latching else "none, as no rule has one"
        raise FieldRefusedError("rule", f"expected a rule with a level `collision`: {known}, got {rule!r}")
    await _carry_out(shared, {"type": "acknowledge", "rule": rule, "by": "POST /v1/reactions/acknowledge"})
    return shared.out(scene)


@router.post(
    "/v1/reactions/expected",
    summary="Announce an expected contact",
    responses={**BODY_REFUSALS, **_NOT_POSSIBLE},
)
async def expected(shared: Shared, scene: SharedScene, request: ExpectedIn) -> ReactionsOut:
    """Open or close the window of an expected contact; the rules file defines its point and force."""
    known = [window.name for window in _rules(shared).expected]
    if not known:
        raise FieldRefusedError("name", f"the rules have no expected contacts, got {request.name!r}")
    if request.name not in known:
        raise FieldRefusedError("name", f"expected one of {', '.join(known)}, got {request.name!r}")
    await _carry_out(shared, {"type": "announce" if request.open else "withdraw", "name": request.name})
    return shared.out(scene)


def _rules(shared: Reactions) -> ReactionRules:
    if shared.rules is None:
        raise HTTPException(503, "there are no rules: start the service with --reactions FILE")
    return shared.rules


async def _carry_out(shared: Reactions, command: dict[str, str | None]) -> None:
    if not await shared.request(command):
        raise HTTPException(503, "no pipeline runs that could carry it out")
