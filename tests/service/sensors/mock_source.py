"""Settings and samples of a `LiveSource` that the mock feeds."""

import numpy as np

from contactsense.scene import Scene
from contactsense.service.mock.servers import MockSettings
from contactsense.service.sensors.source_settings import SourceSettings
from tests.service.loopback import SmallFeed, until

# Longer than `KNOWN_WITHIN`: what comes after its end never changes.
SECONDS = np.arange(35000) / 500.0
# Each component grows by 1 a second: an error of the value is an error of the instant.
WRENCH = SECONDS[:, None] + np.arange(6)
FEED = SmallFeed(n=len(WRENCH), base_wrench=WRENCH)
SCENE = Scene(robot="ur5e")
KNOWN_WITHIN = 60.0
"""A force/torque sensor's clock is known after this time, even on a busy computer [s]."""
MOCK = MockSettings(rtde_port=0, netft_port=0, http_port=0)


def settings_for(servers, **changes):
    changes = {"wrench_rate": 1000.0} | changes
    return SourceSettings(
        servers.rtde.host,
        servers.rtde.port,
        wrench_host=servers.netft.host,
        wrench_port=servers.netft.port,
        wrench_http_port=servers.netft.http_port,
        **changes,
    )


def start_when_connected(servers, source):
    """Start the simulated time of a robot that a source reads, so that it sees the first sample."""
    assert until(lambda: source.poll(0.01) or servers.rtde.streams)
    servers.clock.start()


def collect(source, n):
    samples = []
    assert until(lambda: samples.extend(source.poll(0.1)) or len(samples) >= n), source.health
    return samples
