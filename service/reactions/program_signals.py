"""What a robot program tells by its RTDE outputs: it acknowledges, or announces an expected contact."""

from collections.abc import Mapping

from contactsense.service.reactions.rules import Inputs
from contactsense.service.wire.rtde import Number


class ProgramSignals:
    """Finds the changes of a program's outputs.

    Args:
        outputs: Their names.
    """

    def __init__(self, outputs: Inputs) -> None:
        self._outputs = outputs
        self._last: dict[str, int] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """RTDE outputs that are read."""
        return tuple(name for name in (self._outputs.acknowledge, self._outputs.announce) if name is not None)

    def acknowledged(self, values: Mapping[str, Number]) -> bool:
        """Whether the program's output to acknowledge has just left 0."""
        before, _ = self._change(self._outputs.acknowledge, values)
        return before == 0

    def announced(self, values: Mapping[str, Number]) -> int | None:
        """The value of the contact that the program has just announced, which may be that of none; None: the
        output is as it was."""
        _, value = self._change(self._outputs.announce, values)
        return value

    def _change(self, name: str | None, values: Mapping[str, Number]) -> tuple[int | None, int | None]:
        """Value of an output before and after a change; None where it is as it was, or is read for the first
        time."""
        if name is None or name not in values:
            return None, None
        value, before = int(values[name]), self._last.get(name)
        self._last[name] = value
        return (None, None) if before is None or value == before else (before, value)
