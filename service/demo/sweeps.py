"""Motions for the demonstration of reactions: programs that move the simulated arm into obstacles."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.script import SCRIPTS, Script
from contactsense.service.mock.controller.contact_log import ContactRecord
from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.urscript.parser import parse

SCRIPT = SCRIPTS / "react.yaml"
"""Script with arm and obstacles."""
SPEED, ACCELERATION = 0.6, 2.0
"""Limits of the sweeps' joint motion [rad/s, rad/s^2]."""
SETTLE = 0.5
"""Time at rest after a motion [s]."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """Motion of one joint with an obstacle in the way."""

    obstacle: str
    """Name of the obstacle in the script."""
    joint: int
    """Number of the joint, from 0."""
    angle: float
    """Rotation of the joint [rad]."""

    def program(self, start: Sequence[float]) -> str:
        """Return the sweep as a URScript program, from a posture [rad]."""
        end = list(start)
        end[self.joint] += self.angle
        return move_program("sweep", end)

    @property
    def duration(self) -> float:
        """Duration of the sweep without an obstacle [s]."""
        far = abs(self.angle)
        return max(1.875 * far / SPEED, float(np.sqrt(5.774 * far / ACCELERATION)))


SWEEPS = (
    Sweep("forearm post", 0, 1.0),
    Sweep("upper arm post", 1, -0.6),
    Sweep("wrist post", 1, 0.6),
)


@dataclass(frozen=True, slots=True)
class Collision:
    """Result of one sweep."""

    link: str
    """The link that touched the obstacle first."""
    speed: float
    """Speed of the contact point at the first touch [m/s]."""
    peak_force: float
    """Largest force [N]."""
    stopping_distance: float
    """Distance that the link moved after the touch [m]."""
    stopped_after: float
    """Time from the touch to the largest force [s]."""

    @classmethod
    def of(cls, records: Sequence[ContactRecord], obstacle: str) -> "Collision | None":
        """Extract the collision with an obstacle from a log; None if nothing touched it."""
        mine = [record for record in records if record.obstacle == obstacle]
        if not mine:
            return None
        worst = max(mine, key=lambda record: record.peak_force)
        return cls(
            link=mine[0].link,
            speed=mine[0].speed,
            peak_force=worst.peak_force,
            stopping_distance=max(record.stopping_distance for record in mine),
            stopped_after=worst.peak_time - mine[0].start,
        )

    def as_dict(self) -> dict[str, object]:
        """Return the result as a dictionary for JSON."""
        return asdict(self)


def move_program(name: str, q: Sequence[float]) -> str:
    """Return a URScript program that moves to a posture [rad]."""
    return f"def {name}():\n  movej({list(q)}, a={ACCELERATION}, v={SPEED})\nend\n"


def without_reaction(sweep: Sweep) -> Collision | None:
    """Run the sweep without a reaction; only the simulated controller itself may stop it. The same
    simulation, but in this process, without communication and without waiting."""
    script = Script.load(SCRIPT)
    robot = RobotController(Cell.of_script(script), script)
    robot.advance_to(script.duration)
    robot.run(parse(sweep.program(script.trajectory.start)))
    robot.advance_to(script.duration + sweep.duration + SETTLE)
    return Collision.of(robot.contacts.records, sweep.obstacle)
