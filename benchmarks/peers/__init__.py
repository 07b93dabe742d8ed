"""What others do, written from what their papers say: each a `benchmarks.method.Method`."""

from collections.abc import Callable
from typing import NamedTuple

from benchmarks.method import Method
from benchmarks.peers.exact_contact import ExactContact
from benchmarks.peers.exploration_filter import ExplorationFilter
from benchmarks.peers.force_line import ForceLine
from benchmarks.peers.particle_filter import ParticleFilter
from benchmarks.peers.torque_samples import TorqueSamples
from contactsense import Scene


class Peer(NamedTuple):
    """A method of others, and the sensors that it needs."""

    sensors: str
    """Key of `service.bench.static_cases.SENSORS`."""
    make: Callable[[Scene], Method]
    """The method for the arm, surface and noise of a scene with those sensors."""


def _wrench_axis(scene: Scene) -> Method:
    return ExactContact(scene, closed_form=False)


def _closed_form(scene: Scene) -> Method:
    return ExactContact(scene, closed_form=True)


PEERS = (
    Peer("all", ForceLine),
    Peer("all", _wrench_axis),
    Peer("all", _closed_form),
    Peer("all", ParticleFilter),
    Peer("all", ExplorationFilter),
    Peer("torques", TorqueSamples),
    Peer("torques", ParticleFilter),
)
"""All single-contact methods that are compared with ours."""
