"""State of the reactions: a part of `GET /v1/health`, and with more detail `GET /v1/reactions`."""

from typing import Any, Literal

from pydantic import BaseModel, Field


class ActionHealth(BaseModel):
    """State of one action."""

    type: str = Field(description="Its type in the rules file, such as `registers`.")
    state: Literal["idle", "ok", "failing"] = Field(
        "idle", description="idle: not needed so far; ok, failing: by the latest attempt or the connection."
    )
    started: int = Field(0, description="How often it was started.")
    failed: int = Field(0, description="How often it failed.")
    error: str = Field("", description="What is wrong, with what to do about it; empty if nothing is.")
    took: float | None = Field(None, description="Time that the latest attempt took [s].")


def failure(name: str, action: ActionHealth) -> str:
    """What is wrong with an action that has an error, for a person."""
    return f"action {name} failed at its latest attempt: {action.error}"


class ReactionsHealth(BaseModel):
    """State of all actions and rules."""

    status: Literal["off", "ok", "failing"] = Field(
        "off", description="off: no rules; failing: the latest attempt of an action failed, see actions."
    )
    latched: int = Field(0, description="Collisions that have not been acknowledged.")
    lowered: float | None = Field(
        None,
        description="Fraction to which a level has lowered the speed slider: one that is active, has ended "
        "without a connection, or was active when the service last ended; null: no level has anything to "
        "raise. An action without restore leaves the slider low, with null, when its level ends.",
    )
    actions: dict[str, ActionHealth] = Field({}, description="State of each action, by name.")


class LatchOut(BaseModel):
    """A collision that has not been acknowledged."""

    rule: str = Field(description="Name of its rule.")
    t: float = Field(description="When, on the robot's clock [s].")
    link: str = Field(description="The most probable link when it was decided.")
    force: float = Field(description="Force when it was decided [N].")


class ReactionsOut(BaseModel):
    """State of the rules."""

    status: Literal["off", "ok", "failing"] = Field("off", description="As in the health of the service.")
    rules: list[str] = Field([], description="Each rule in words; its actions are named.")
    does: dict[str, str] = Field({}, description="What each action does, in words, by name.")
    active: list[dict[str, Any]] = Field([], description="Levels that have begun and not ended.")
    latched: list[LatchOut] = Field([], description="Collisions that have not been acknowledged.")
    expected: list[str] = Field([], description="Expected contacts whose windows are open.")
    actions: dict[str, ActionHealth] = Field({}, description="State of each action, by name.")
