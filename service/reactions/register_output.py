"""The registers that the robot program reads: what they show, and when they are written."""

from collections.abc import Sequence

from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.rtde_inputs import RtdeInputs
from contactsense.types import Estimate

RECIPE = "registers"
"""Name of the recipe of RTDE inputs."""


class RegisterOutput:
    """Shows the latest decision of the highest active level, with a heartbeat.

    Args:
        action: Which registers.
        name: Of the action.
        inputs: Connection to the controller; None: there is none.
    """

    def __init__(self, action: RegistersAction, name: str, inputs: RtdeInputs | None) -> None:
        self._action, self._name, self._inputs = action, name, inputs
        self.shown: Decision | None = None
        """The decision that began the level, with the present force and point while its contact lasts; None:
        no level is active."""
        self._chosen: Decision | None = None  # the same, as it was when the level began
        self.latches_known = False
        """Whether the collisions latched by an earlier process are known; nothing is written before."""
        self._beat = False
        self._written_at = -float("inf")

    @property
    def problem(self) -> str:
        """Why nothing can be written where the connection tells no error."""
        return "not connected" if self.latches_known else "the latched collisions of before are not known yet"

    def select(self, active: Sequence[Decision]) -> None:
        """Choose among the active levels."""
        shown = [decision for decision in active if self._name in decision.actions]
        chosen = max(shown, key=lambda each: (each.level == "collision", each.t), default=None)
        if chosen != self._chosen:  # of one that goes on, the present force is shown
            self._chosen = self.shown = chosen

    def follow(self, engine: Engine, estimate: Estimate) -> None:
        """Show force and place as estimated now; of a contact that has ended, those with which the level
        began."""
        if self._chosen is None:
            return
        assert self.shown is not None
        # A degraded estimate may lack a contact that lasts.
        ended = estimate.status != "degraded" and all(c.id != self._chosen.contact for c in estimate.contacts)
        self.shown = self._chosen if ended else engine.updated(self.shown, estimate)

    def is_due(self, now: float) -> bool:
        """Whether the heartbeat is due. `now` is the host's monotonic clock [s]."""
        return now - self._written_at >= self._action.period - 0.001

    def write(self, t: float, degraded: bool, now: float) -> bool:
        """Write the registers.

        Args:
            t: Time of the newest sample, on the robot's clock [s].
            degraded: Whether no force can be told.
            now: The host's monotonic clock [s].

        Returns:
            Whether that was possible.
        """
        if self._inputs is None or not self.latches_known:
            return False
        self._beat = not self._beat
        self._written_at = now
        return self._inputs.write(RECIPE, self._action.values(self.shown, t, self._beat, degraded))
