"""Stop with `stopJ` of ur_rtde's control interface, in a child process, for robots controlled by ur_rtde."""

import contextlib
import select
import subprocess
import sys
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr

from contactsense.service.reactions.actions.base import ActionError, ExecutedAction

CHILD = "contactsense.service.reactions.actions.ur_rtde_stop_child"
_END = 0.5
"""Time that the child has to end by itself [s]."""


class UrRtdeStopAction(ExecutedAction):
    """The child process connects when the service starts and thereby replaces the robot's program by
    ur_rtde's. Use it only for robots that nothing else controls. A child that dies is restarted when it is
    needed."""

    type: Literal["ur_rtde_stop"]
    """Kind of the action."""
    deceleration: Annotated[float, Field(ge=0.01, le=100.0)] = 8.0
    """Deceleration [rad/s^2]."""
    frequency: Annotated[float, Field(ge=1.0, le=500.0)] = 500.0
    """Frequency of the control interface [Hz]."""
    timeout: Annotated[float, Field(gt=0.0, le=60.0)] = 10.0
    """Time limit, including the connection [s]."""
    _child: "subprocess.Popen[str] | None" = PrivateAttr(None)

    def prepare(self, host: str) -> None:
        """Start the child and connect; see `ExecutedAction.prepare`."""
        if self._child is not None and self._child.poll() is None:
            return
        self._kill()
        self._child = subprocess.Popen(
            [sys.executable, "-P", "-m", CHILD, host, str(self.frequency), str(self.deceleration)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._expect("ready")

    def perform(self, decision: dict[str, Any], host: str) -> str:
        """Stop the robot; see `ExecutedAction.perform`."""
        self.prepare(host)
        assert self._child is not None
        assert self._child.stdin is not None
        try:
            self._child.stdin.write("stop\n")
            self._child.stdin.flush()
        except OSError:
            self._kill()
            raise ActionError("ur_rtde: its process has died") from None
        self._expect("stopped")
        return "stopJ is done"

    def _expect(self, word: str) -> None:
        assert self._child is not None
        assert self._child.stdout is not None
        if not select.select([self._child.stdout], [], [], self.timeout)[0]:
            self._kill()
            raise ActionError(f"ur_rtde: not {word} within {self.timeout:g} s; its process was killed")
        line = self._child.stdout.readline().strip()
        if line != word:
            self._kill()
            raise ActionError(f"ur_rtde: {line or 'its process has died'}")

    def close(self) -> None:
        """End the child, which first disconnects from the robot; it is killed if that takes too long."""
        if self._child is not None and self._child.stdin is not None:
            with contextlib.suppress(OSError, subprocess.TimeoutExpired):
                self._child.stdin.close()
                self._child.wait(_END)
        self._kill()

    def _kill(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child.wait()
            for pipe in (self._child.stdin, self._child.stdout):
                if pipe is not None:
                    pipe.close()
            self._child = None

    def describe(self) -> str:
        """Return a short description of the action."""
        return f"ur_rtde: stopJ({self.deceleration:g})"
