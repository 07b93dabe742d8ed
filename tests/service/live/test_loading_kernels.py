"""What serves the stream loads no machine code while it does: that takes tenths of a second."""

import subprocess
import sys

import pytest

SCRIPT = """
import numpy as np
from contactsense import LinkWrenchSensor, Scene, WrenchSensor
from contactsense.robots.tool import Tool
from contactsense.robots.jit.kernel import _SOURCES, loaded
from contactsense.service.api.service import PlausibleLimits

def in_memory():
    return {kernel for kernel in _SOURCES if loaded(kernel)}

sensors = dict(
    tool=Tool(mass=1.0),
    wrist_wrench=WrenchSensor(range=(400.0, 60.0)),
    link_wrenches=(LinkWrenchSensor(name="elbow", link="forearm", range=(900.0, 90.0)),),
    base_wrench=WrenchSensor(range=(900.0, 900.0)),
)
for scene in (Scene(robot="ur5e"), Scene(robot="ur5e", **sensors)):
    limits = PlausibleLimits(scene)
    before = in_memory()
    q, links = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0]), {name: np.ones(6) for name in scene.link_sensors}
    for external in (True, False):
        for wrench in (np.array([0.0, 9.0, 0.0, 1.0, 0.0, 0.0]), limits.weight.wrench(q)):
            limits.request(q, wrench, np.zeros(6), links, external)
    print("loaded later:", len(in_memory() - before))
"""


@pytest.mark.slow
def test_a_request_loads_no_kernel_in_the_process_of_the_web_service() -> None:
    """It checks the request; what explains it runs elsewhere (`service/live/locate_process.py`)."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["loaded later: 0"] * 2
