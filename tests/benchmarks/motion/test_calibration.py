"""Probabilities and regions of contacts in a stream: which answers are judged, and how."""

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner

from contactsense.benchmarks.accuracy.static_cases import COLUMNS
from contactsense.benchmarks.motion.calibration import motion_calibration, summaries
from contactsense.benchmarks.motion.score import AGES, FORCE, samples_at_ages
from contactsense.benchmarks.motion.streams import read
from tests.shared import shared


def test_each_contact_is_judged_once_at_each_age_that_it_reaches() -> None:
    streams = read(shared("truth"), "ur5e", "motion")[:3]
    found = summaries(streams, COLUMNS[1], wrong=False)
    ages = [age for stream in streams for age in samples_at_ages(stream).values()]
    for summary in found:
        total = ages.count(float(summary.sensors.removesuffix(" s")))
        assert round(summary.samples / (1.0 - summary.no_answer)) == total
    assert [summary.sensors for summary in found] == [f"{age:g} s" for age in AGES]
    # Samples of pairs and of weak contacts are not judged.
    for stream in streams:
        force = np.linalg.norm(stream.wrench[:, :3], axis=1)
        assert all(force[i] >= FORCE and stream.link[i] >= 0 for i in samples_at_ages(stream))


def test_the_command_prints_json() -> None:
    folder: Path = shared("truth")
    command = [str(folder), "--robot", "ur5e", "--level", "1", "--json"]
    done = CliRunner().invoke(motion_calibration, command, catch_exceptions=False)
    results = json.loads(done.stdout)["results"]
    assert {r["noise"]["torque"] for r in results} == {COLUMNS[1].torque}
    # Contacts of 0.3 s and longer: known well, so that regions hold most and probabilities are high.
    late = next(r for r in results if r["sensors"] == "1 s")
    assert late["region"] > 0.6
