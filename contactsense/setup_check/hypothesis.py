"""One way in which a scene, or how a signal is read, may be wrong."""

from dataclasses import dataclass

from contactsense.setup_check.lines import Line
from contactsense.setup_check.setup import Free, Setup


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
