"""What the state of the sensors says of losses."""

import pytest

from contactsense.service.sensors.clients.netft_client import WrenchHealth
from contactsense.service.sensors.clients.robot_stream import StreamHealth
from contactsense.service.sensors.source_health import SourceHealth


def wrench(lost: int) -> WrenchHealth:
    return WrenchHealth("streaming", "", 100, lost, 0, 0, 0, 0, 0, 0, 1000.0, 0.001)


@pytest.mark.parametrize(
    ("samples", "base", "elbow", "told"),
    [
        (0, 0, 0, ""),
        (2, 0, 0, "2 samples"),
        (0, 3, 4, "7 force/torque readings"),
        (2, 3, 0, "2 samples and 3 force/torque readings"),
    ],
)
def test_losses_are_named_by_what_was_lost(samples: int, base: int, elbow: int, told: str) -> None:
    """Those of boxes within the arm, too."""
    robot = StreamHealth(lost=samples)
    links = {"link_wrenches.elbow": wrench(elbow)}
    assert SourceHealth(robot, wrench(base), 0, 0, links).losses == told
    without = SourceHealth(robot, None, 0, 0)
    assert without.losses == ("2 samples" if samples else "")
