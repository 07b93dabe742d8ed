"""The simulated robot and its sensor behind proxies that spoil what they send."""

from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.interfaces.wire_faults import Fault
from tests.service.faults.robot_proxy import ROBOT_FAULTS, RtdeProxy
from tests.service.faults.sensor_proxy import SENSOR_FAULTS, NetFtProxy
from tests.service.simulated_devices import SimulatedDevices


class SpoiledDevices(SimulatedDevices):
    """They work until a fault is begun."""

    def __init__(self, script: Script) -> None:
        super().__init__(script)
        rtde, readings, self._page = super().ports()
        self._robot = RtdeProxy("127.0.0.1", rtde)
        self._sensor = NetFtProxy("127.0.0.1", readings)

    def ports(self) -> tuple[int, int, int]:
        """Of both proxies, and of the configuration page."""
        return self._robot.port, self._sensor.port, self._page

    def begin(self, where: str, name: str) -> None:
        """Begin a fault of the mock server, the robot, the sensor or the handshake, and end all others."""
        self.servers.rtde.fault = Fault[name] if where == "server" else Fault.NONE
        self._robot.fault = ROBOT_FAULTS[name] if where == "robot" else None
        self._sensor.fault = SENSOR_FAULTS[name] if where == "sensor" else None
        self._robot.handshake = name if where == "handshake" else None

    def end(self) -> None:
        """End all faults."""
        self.begin("", "")
