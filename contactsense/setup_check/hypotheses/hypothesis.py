"""One way in which a scene, or how a signal is read, may be wrong."""

from dataclasses import dataclass
from typing import NamedTuple

from contactsense.setup_check.lines import Line
from contactsense.setup_check.setup import Free, Setup


class SecondLine(NamedTuple):
    """A line that is wrong beside that of a hypothesis."""

    line: Line
    text: str
    """How it may have arisen; may be empty."""
    setup: Setup
    """With the other value of this line alone."""


@dataclass(frozen=True)
class Hypothesis:
    """One way in which the setup may be wrong."""

    line: Line
    starts: tuple[tuple[str, Setup], ...]
    """Alternatives, each with the remark that explains it (may be empty)."""
    free: tuple[Free, ...] = ()
    """Continuous parameters to estimate."""
    special: bool = False
    """Whether another hypothesis of the same line includes it: that one says whether the line fits."""
    absorbed: bool = False
    """Whether the nuisances can take up the mistake, at the cost of their priors: no residual need fall."""
    joint: int | None = None
    """Index of the joint whose torque alone it explains; None: it is of no single joint."""
    second_line: SecondLine | None = None
    """Another line that is wrong as well: `starts` differ in `line` from its setup. None: `line` alone is
    wrong."""
