"""Probabilities and regions of contacts in a stream: which answers are judged, and how."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense import Contact, Estimate, Sample, Scene
from contactsense.benchmarks.motion import calibration
from contactsense.benchmarks.motion.score import samples_at_ages
from contactsense.benchmarks.motion.streams import Event, Stream
from contactsense.benchmarks.static_truth.cases import COLUMNS

N = 1000
TRUTH = np.array([0.1, 0.2, 0.3])


def stream() -> Stream:
    """Two seconds at 500 Hz: a hold of 0.4 s on link 3 from 0.4 s, an impact of 50 ms from 1.4 s."""
    touched = np.zeros(N, dtype=bool)
    touched[200:400] = touched[700:725] = True
    zero = np.zeros((N, 6))
    wrench = np.where(touched[:, None], [0.0, 0.0, -10.0, 0.0, 0.0, 0.0], 0.0)
    return Stream(
        robot="ur5e", gravity=9.81, suite="motion", run=0, kind="slow", multi=False,
        t=np.arange(N) * 0.002, q=zero, qd=zero, torque=zero, base_wrench=zero, noise_torque=zero,
        noise_wrench=zero, touched=touched, link=np.where(touched, 3, -1), point_base=np.tile(TRUTH, (N, 1)),
        normal_base=np.tile([0.0, 0.0, 1.0], (N, 1)), wrench=wrench,
        events=(Event(200, 400, "hold"), Event(700, 725, "impact")),
    )  # fmt: skip


class Answers:
    """Stands for a `Localizer`: from 0.1 s after the hold's onset on the truth is known, then it is 50 mm off
    and sure of it."""

    def __init__(self, scene: Scene) -> None:
        pass

    def run(self, recording: Iterator[Sample]) -> Iterator[Estimate]:
        for i, _ in enumerate(recording):
            place = TRUTH + np.array([0.05 if i > 300 else 0.0, 0.0, 0.0])
            contact = Contact(
                "forearm", 3, 0, 1.0, np.zeros(3), place, np.array([0.0, 0.0, 1.0]),
                np.array([0.0, 0.0, -10.0]), 0.0, 1e-6 * np.eye(3),
            )  # fmt: skip
            yield Estimate(
                0.002 * i, "contact", (contact,) if 250 <= i < 400 else (), np.eye(7)[3],
                np.zeros(6), np.zeros((6, 6)),
            )  # fmt: skip


@pytest.fixture
def answered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "Localizer", Answers)


@pytest.mark.usefixtures("answered")
def test_each_contact_is_judged_once_at_each_age_that_it_reaches() -> None:
    assert samples_at_ages(stream()) == {210: 0.02, 250: 0.1, 350: 0.3, 710: 0.02}
    early, late = calibration.summaries([stream()], COLUMNS[0], wrong=False)
    # 20 ms after both onsets there is no answer.
    assert (early.sensors, early.samples, early.no_answer, early.region.found) == ("0.1 s", 1, 0.0, 1.0)
    assert (late.sensors, late.samples, late.region.found) == ("0.3 s", 1, 0.0)
    assert late.statements["place"].error == pytest.approx(1.0)
    assert late.statements["link"].error == 0.0


@pytest.mark.usefixtures("answered")
def test_slides_are_judged_apart() -> None:
    slide = replace(stream(), events=(Event(200, 400, "slide"), Event(700, 725, "impact")))
    found = calibration.summaries([stream(), slide], COLUMNS[0], wrong=False)
    assert [(one.sensors, one.samples) for one in found] == [
        ("0.1 s", 1), ("0.3 s", 1), ("0.1 s, slide", 1), ("0.3 s, slide", 1)
    ]  # fmt: skip


@pytest.mark.usefixtures("answered")
def test_noise_is_drawn_anew_and_answers_are_judged_together() -> None:
    early, _ = calibration.summaries([stream()], COLUMNS[1], wrong=False, draws=3)
    assert early.samples == 3


def test_masses_are_drawn_for_each_run_and_their_error_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes: list[Scene] = []

    class Known(Answers):
        def __init__(self, scene: Scene) -> None:
            scenes.append(scene)

    monkeypatch.setattr(calibration, "Localizer", Known)
    calibration.summaries([stream(), stream()], COLUMNS[1], wrong=False, draws=2, mass_error=0.1)
    exact, *drawn = scenes
    assert [scene.inertia_error for scene in scenes] == [0.0, 0.1, 0.1]
    ratios = [
        [link.inertia.mass / true.inertia.mass for link, true in zip(*links, strict=True)]
        for links in ((scene.robot.links, exact.robot.links) for scene in drawn)
    ]
    assert 0.05 < np.std(ratios) < 0.15
    assert not np.isclose(*ratios).any()
    for link, ratio, true in zip(drawn[0].robot.links, ratios[0], exact.robot.links, strict=True):
        np.testing.assert_allclose(link.inertia.tensor, ratio * true.inertia.tensor)
        np.testing.assert_array_equal(link.inertia.com, true.inertia.com)


@pytest.mark.usefixtures("answered")
def test_the_command_prints_a_table_and_json(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(calibration, "read", lambda *_: [stream()])
    command = [str(tmp_path), "--robot", "ur5e", "--level", "1"]
    table = CliRunner().invoke(calibration.motion_calibration, command, catch_exceptions=False)
    assert "calibration, contacts over time" in table.stdout
    assert "0.3 s" in table.stdout
    done = CliRunner().invoke(calibration.motion_calibration, [*command, "--json"], catch_exceptions=False)
    results = json.loads(done.stdout)["results"]
    assert [(r["sensors"], r["region"]) for r in results] == [("0.1 s", 1.0), ("0.3 s", 0.0)]
    assert {r["noise"]["torque"] for r in results} == {COLUMNS[1].torque}
