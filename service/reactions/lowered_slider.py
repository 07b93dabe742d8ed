"""The robot's speed slider: lowered by a level and raised at its end, also after an earlier process."""

from typing import Literal

from contactsense.service.reactions.actions.speed_slider import SLIDER_READING, SpeedSliderAction
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.types import Estimate

RECIPE = "speed_slider"
"""Name of the recipe of RTDE inputs."""
_SAME_FRACTION = 0.005
"""Two readings of the slider that differ by less are the same; people set it in steps of 1 %."""
_FREE = 1.0
"""Time without contact after which the slider that an earlier process has lowered is raised [s]: a force that
still acts is found before."""


class LoweredSlider:
    """Writes the slider, and knows whether it is still to be raised.

    Args:
        action: The fractions.
        inputs: Connection to the controller.
    """

    def __init__(self, action: SpeedSliderAction, inputs: RtdeInputs) -> None:
        self._action, self._inputs = action, inputs
        self._due: Literal["lower", "raise"] | None = None  # what the controller does not have yet
        self._written: float | None = None  # by a level of this process
        self._left: float | None = None  # by an earlier process, which did not see the end of its level
        self._free_since: float | None = None  # on the robot's clock

    @property
    def lowered(self) -> float | None:
        """Fraction that a level has written, here or in an earlier process, until the slider is raised; None:
        nothing is to be raised."""
        return self._left if self._written is None else self._written

    def take_over(self, left: float | None) -> None:
        """Take over the fraction that an earlier process has left."""
        self._left = left if self._written is None else None

    def lower(self) -> None:
        """A level begins or, after a lost connection, still lasts: lower the slider."""
        self._due = "lower"

    def end(self) -> bool:
        """The last level has ended: raise the slider; returns False if this process has nothing to raise."""
        # A level that was never written has changed nothing.
        self._due = None if self._written is None or self._action.restore is None else "raise"
        if self._due is None:
            self._written = None
        return self._due is not None

    def write(self) -> float | None:
        """Write what is due; returns the fraction, None if nothing is or the controller cannot take it."""
        value = {"lower": self._action.fraction, "raise": self._action.restore, None: None}[self._due]
        if value is None or not self._inputs.write(RECIPE, (1, value)):
            return None
        self._written = value if self._due == "lower" else None
        self._left = self._due = None
        return value

    def watch(self, estimate: Estimate, active: bool) -> str:
        """Raise what an earlier process has left, once it is known that no force acts.

        Args:
            estimate: The next estimate of the stream.
            active: Whether a level wants the arm to be slow.

        Returns:
            What was done, for a person; empty if nothing was.
        """
        if active or estimate.status != "none":
            self._free_since = None
        elif self._free_since is None or estimate.t < self._free_since:
            self._free_since = estimate.t
        elif estimate.t - self._free_since >= _FREE:
            return self.raise_left()
        return ""

    def raise_left(self) -> str:
        """Raise what an earlier process has left, unless somebody has moved it since.

        Returns:
            What was done, for a person; empty if nothing was: there is nothing to raise, or no connection.
        """
        left, found, restore = self._left, self._inputs.values.get(SLIDER_READING), self._action.restore
        if left is None or found is None:
            return ""
        words = f"left at {as_percent(left)} by an earlier process"
        if abs(found - left) > _SAME_FRACTION:
            words += f"; somebody has set {as_percent(found)} since"
        elif restore is None:
            words += ", and stays there: no restore is stated"
        elif self._inputs.write(RECIPE, (1, restore)):
            words = (
                f"done: raised to {as_percent(restore)}; an earlier process had left it at {as_percent(left)}"
            )
        else:
            return ""
        self._left = None
        return words


def as_percent(fraction: float) -> str:
    """A fraction of the programmed speed for a person."""
    return f"{100.0 * fraction:.3g} %"
