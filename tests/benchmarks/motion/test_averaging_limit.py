"""What lossless averaging could give: more with time, all without noise, and nothing that no sensor feels."""

from dataclasses import replace

import numpy as np

from contactsense.benchmarks.motion.averaging_limit import averaging_limit
from contactsense.benchmarks.motion.command import scene_for
from contactsense.benchmarks.motion.score import is_touched_by_force
from contactsense.benchmarks.motion.streams import Stream, read
from contactsense.benchmarks.static_truth.cases import Noise
from tests.shared import shared

NOISE = Noise(0.25, 0.05, 1.0)


def _rows() -> list[tuple[Stream, int]]:
    """One sample in forty that is touched; none on the base link."""
    return [
        (stream, int(i))
        for stream in read(shared("truth/motion_ur5e.npz").parent, "ur5e", "motion")
        for i in np.flatnonzero(is_touched_by_force(stream))[::40]
    ]


def test_more_samples_name_more_links_and_the_base_sensor_most() -> None:
    rows = _rows()
    torques = scene_for(rows[0][0], NOISE, False, sensors="torques")
    found = [averaging_limit(torques, rows, NOISE, age, (False, True)) for age in (0.002, 0.1, 10.0)]
    right = [limit.link_right for limit in found]
    felt = [limit.felt for limit in found]
    assert right == sorted(right)
    assert felt == sorted(felt)
    assert right[-1] > right[0] + 0.3
    assert all(a <= b for a, b in zip(right, felt, strict=True))
    both = averaging_limit(scene_for(rows[0][0], NOISE, False), rows, NOISE, 10.0)
    assert both.link_right > 0.97
    assert both.link_right > right[-1]


def test_without_noise_every_link_is_right() -> None:
    rows = _rows()
    none = Noise(0.0, 0.0, 0.0)
    assert averaging_limit(scene_for(rows[0][0], none, False), rows, none, 0.002).link_right > 0.98


def test_no_joint_feels_a_touch_on_the_base_link() -> None:
    rows = [(replace(stream, link=np.zeros_like(stream.link)), i) for stream, i in _rows()]
    scene = scene_for(rows[0][0], NOISE, False, sensors="torques")
    right, felt = averaging_limit(scene, rows, NOISE, 1.0, (False, True))
    assert right <= felt < 0.01
