"""Result of a check of a setup: one finding per line of the scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from contactsense.calibration.contacts.contact_test import SuspectedContact
from contactsense.setup_check.lines import Line

Verdict = Literal["fits", "does_not_fit", "cannot_tell"]
"""What the motion says of a line: it fits, another value fits better, or the motion does not determine it."""
FITS_BETTER = "another value fits better, though not clearly"
"""Begins the remark on an undetermined line of which another value fits better, by less than is needed to
propose it; the value follows."""

NOT_RECORDED = "not recorded"
"""Remark on a line of a sensor that the recordings lack."""


@dataclass(frozen=True)
class WrenchResidual:
    """Root mean squares of what remains of a force/torque sensor's readings."""

    force: float
    """Of its forces [N]."""
    moment: float
    """Of its moments [Nm]."""


@dataclass(frozen=True)
class Residuals:
    """Root mean squares of what a setup leaves unexplained, below 2 Hz, after biases, joint friction and
    errors of the links' inertia are estimated. None: not measured."""

    force: float | None
    """Of the base sensor's forces [N]."""
    moment: float | None
    """Of its moments [Nm]."""
    torque: float | None
    """Of the joint torques [Nm]."""
    links: Mapping[str, WrenchResidual] = field(default_factory=dict)
    """Of each sensor within the arm that was measured, by key of `Scene.link_sensors`."""


@dataclass(frozen=True)
class Finding:
    """What the motion says about one line of the scene."""

    line: Line
    verdict: Verdict
    stated: str
    """The scene's value."""
    proposed: str | None = None
    """The value that fits, where the scene's does not."""
    remark: str = ""
    """How the mistake may have arisen; or why it is undetermined."""
    std: tuple[float, ...] = ()
    """Standard deviations of a line with continuous values, in SI units; empty for others."""
    before: Residuals | None = None
    """With the scene's value, where it does not fit, and the proposed values of all other such lines."""
    after: Residuals | None = None
    """With all proposed values."""
    evidence: float | None = None
    """By how much twice the log likelihood rises with the proposed value, less the penalty for its free
    parameters; or falls, with the best other value, where the scene's fits or the line is undetermined. None
    where no other value was found."""
    instead: tuple[Line, ...] = ()
    """Other lines whose change would explain the readings about as well."""


@dataclass(frozen=True)
class SetupCheck:
    """What contact-free motion says about every line of a scene."""

    findings: tuple[Finding, ...]
    """Lines that do not fit first: those that signals contradict by themselves, then those that explain
    most."""
    residuals: Residuals
    """With all proposed values."""
    unexplained: tuple[str, ...]
    """Signals that remain unexplained with every change that was tried, one readable line each."""
    seconds: float
    """Length of the recordings [s]."""
    base_offset: tuple[float, ...] | None = None
    """What the base sensor reads in the median beyond weight and bias of the scene, in its own frame and sign
    [N, Nm], where nothing contradicts the scene and a stream would take that for a contact; else None.
    `contactsense.calibration.calibrate` estimates the bias."""
    friction: tuple[float, ...] | None = None
    """Coulomb friction of each joint in the joint torques [Nm], where the scene states none, nothing
    contradicts it, and a stream would take that for a contact; else None. `calibrate` estimates it."""
    contacts: tuple[SuspectedContact, ...] = ()
    """Stretches in which something seems to push on the arm, as `calibrate` finds them; looked for where
    no lines explain the readings."""
    contacts_left_out: bool = True
    """Whether all else is said of the motion without them; False: that would be too little."""

    @property
    def fits(self) -> bool:
        """Whether nothing contradicts the scene."""
        return not self.unexplained and not self.wrong

    @property
    def wrong(self) -> tuple[Finding, ...]:
        """Findings of the lines that do not fit."""
        return tuple(found for found in self.findings if found.verdict == "does_not_fit")
