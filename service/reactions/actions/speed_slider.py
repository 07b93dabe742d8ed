"""Lower the robot's speed slider."""

from typing import Annotated, Literal

from pydantic import Field

from contactsense.service.reactions.actions.base import ActionSettings

NAMES = ("speed_slider_mask", "speed_slider_fraction")
"""RTDE fields, in the order in which they are written."""

SLIDER_READING = "target_speed_fraction"
"""RTDE output with the slider's fraction."""


class SpeedSliderAction(ActionSettings):
    """Sets a fraction of the programmed speed; never 0, because leaving 0 causes a protective stop."""

    type: Literal["speed_slider"]
    """Kind of the action."""
    fraction: Annotated[float, Field(ge=0.01, le=1.0)]
    """Fraction while the level is active."""
    restore: Annotated[float, Field(ge=0.01, le=1.0)] | None = None
    """Fraction after the last level with this action has ended; None: the slider stays until a person or the
    program raises it."""

    def describe(self) -> str:
        """Return a short description of the action."""
        after = "it stays there" if self.restore is None else f"back to {100 * self.restore:g} % at its end"
        return f"set the speed slider to {100 * self.fraction:g} %, {after}"
