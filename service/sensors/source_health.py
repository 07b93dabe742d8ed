"""State of the sensors of a live source: their connections, and problems with their readings."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from contactsense.service.sensors.clients.netft_client import WrenchHealth
from contactsense.service.sensors.clients.robot_stream import StreamHealth


@dataclass(frozen=True, slots=True)
class SourceHealth:
    """State of the sensors."""

    robot: StreamHealth
    wrench: WrenchHealth | None
    """None if the force/torque values are part of the robot's packets, or if there is no such sensor."""
    unusable: int
    """Robot records without usable joint positions and velocities; not delivered."""
    without_wrench: int
    """Samples delivered without the base wrench that the scene requires: sensor silent, or value not
    finite."""
    links: Mapping[str, WrenchHealth] = field(default_factory=dict)
    """Networked sensors within the arm, by field of the scene."""
    recent: tuple[str, ...] = ()
    """Problems with the readings in the last seconds, one readable line each."""
    reconnects: bool = True
    """Whether lost connections are tried again from here; a controller that pushes its samples connects by
    itself."""

    @property
    def losses(self) -> str:
        """What was lost on the way here, such as `12 samples and 3 force/torque readings`; empty: nothing."""
        boxes = [sensor for sensor in (self.wrench, *self.links.values()) if sensor is not None]
        counts = {"samples": self.robot.lost, "force/torque readings": sum(box.lost for box in boxes)}
        return " and ".join(f"{count} {name}" for name, count in counts.items() if count)

    @property
    def faults(self) -> tuple[str, ...]:
        """Sensors that are not connected, one readable line each."""
        found = []
        if self.robot.state != "streaming":
            found.append(self.robot.error or "no data from the robot yet")
        if self.wrench is not None and self.wrench.state != "streaming":
            found.append(self.wrench.error or "no data from the force/torque sensor yet")
        for name, sensor in self.links.items():
            if sensor.state != "streaming":
                found.append(f"{name}: {sensor.error or 'no data from the sensor yet'}")
        return tuple(found)

    @property
    def trouble(self) -> str:
        """Current problem in one readable line; empty if there is none."""
        return "; ".join((*self.faults, *self.recent))

    @property
    def trouble_while_running(self) -> str:
        """The same for somebody who may wait: it says which problems are being worked on."""
        retried = ("retrying",) if self.faults and self.reconnects else ()
        return "; ".join((*self.faults, *retried, *self.recent))
