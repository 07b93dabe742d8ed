"""Published methods, implemented from their papers, each as a
`contactsense.benchmarks.peers.method.Method`."""

from collections.abc import Callable
from typing import NamedTuple

from contactsense import Scene
from contactsense.benchmarks.peers.exact_contact import ExactContact
from contactsense.benchmarks.peers.exploration_filter import ExplorationFilter
from contactsense.benchmarks.peers.force_line import ForceLine
from contactsense.benchmarks.peers.method import Method
from contactsense.benchmarks.peers.particle_filter import ParticleFilter
from contactsense.benchmarks.peers.torque_samples import TorqueSamples


class Peer(NamedTuple):
    """A published method, and the sensors that it needs."""

    sensors: str
    """Key of `contactsense.benchmarks.static_truth.cases.SENSORS`."""
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
"""All single-contact methods in the comparison."""
