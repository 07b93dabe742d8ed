"""`step` and `run` on a stream of samples of a held posture."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from contactsense import Localizer, Sample
from tests.at_rest import weight
from tests.contactsense.held_posture import Q, push_on_forearm, pushed
from tests.contactsense.precise import PRECISE


def test_silence_then_the_contact(precise: Localizer) -> None:
    point, wrench = push_on_forearm()
    estimates = list(precise.run(pushed(400, wrench, 3)))
    assert estimates[0].status == "degraded"
    assert "settling" in estimates[0].reason
    assert {e.status for e in estimates[45:100]} == {"none"}
    assert estimates[-1].status == "contact"
    assert estimates[-1].contacts[0].link == "forearm"
    np.testing.assert_allclose(estimates[-1].contacts[0].point_base, point, atol=1e-3)
    np.testing.assert_allclose(estimates[-1].wrench, wrench, atol=0.02)
    onset = next(i for i, e in enumerate(estimates) if e.contacts)
    assert 100 <= onset <= 105


def test_a_sensor_that_falls_silent_is_named_and_the_others_go_on(precise: Localizer) -> None:
    _, wrench = push_on_forearm()
    samples = pushed(400, wrench, 3)
    for i in range(200, 300):
        samples[i] = Sample(samples[i].t, samples[i].q, samples[i].qd, samples[i].joint_torque, None)
    estimates = list(precise.run(samples))
    assert estimates[290].status == "degraded"
    assert "base_wrench is missing" in estimates[290].reason
    assert estimates[290].contacts
    assert estimates[-1].status == "contact"


def test_time_that_jumps_back_starts_a_new_stream(precise: Localizer) -> None:
    _, wrench = push_on_forearm()
    samples = pushed(300, wrench, 3)
    again = list(precise.run([*samples, *samples]))
    assert "settling" in again[300].reason
    np.testing.assert_array_equal(again[299].contacts[0].point_base, again[-1].contacts[0].point_base)


@pytest.mark.parametrize("later", [-1.0, 0.0, 5e8])
def test_another_stream_has_nothing_of_the_last_one(precise: Localizer, later: float) -> None:
    """Whatever its clock: a contact that was open ends, numbers go on, and nothing is known any more."""
    _, wrench = push_on_forearm()
    samples = pushed(300, wrench, 3)
    first = list(precise.run(samples))
    start = samples[-1].t + 0.002 + later
    precise.restart("another controller sends: a new stream begins")
    again = [precise.step(replace(sample, t=sample.t + start)) for sample in samples]
    assert first[-1].contacts[0].id == 1
    assert again[0].reason == "another controller sends: a new stream begins"
    (release,) = again[0].events
    assert (release.kind, release.contact, release.t) == ("release", 1, samples[0].t + start)
    assert release.reason == again[0].reason
    assert "another controller" not in again[1].reason
    assert again[-1].contacts[0].id == 2
    assert [estimate.status for estimate in again] == [estimate.status for estimate in first]
    np.testing.assert_allclose(
        again[-1].contacts[0].point_base, first[-1].contacts[0].point_base, rtol=0.0, atol=1e-6
    )


def test_the_biases_of_the_last_stream_are_forgotten() -> None:
    localizer = Localizer(PRECISE)
    _, wrench = push_on_forearm()
    for sample in pushed(400, 1e-4 * wrench, 3, first=0):
        localizer.step(sample)
    assert np.abs(localizer.biases[0]).max() > 0.0
    localizer.restart("another controller")
    assert np.abs(localizer.biases[0]).max() == 0.0


def test_the_reason_for_a_new_stream_waits_for_a_sample_that_is_used(precise: Localizer) -> None:
    samples = pushed(3, np.zeros(6), 3)
    precise.reset()
    precise.restart("another controller")
    assert "another" not in precise.step(replace(samples[0], q=np.full(6, np.nan))).reason
    assert precise.step(samples[1]).reason == "another controller"
    precise.reset()
    assert "another" not in precise.step(samples[2]).reason


def test_samples_may_be_lists_read_only_or_views(precise: Localizer) -> None:
    """What a field holds counts, not how it is kept; and what a caller does with it afterwards is his."""
    torque, reading = weight(PRECISE, Q)
    plain = [Sample(0.002 * i, Q, np.zeros(6), torque, reading) for i in range(60)]
    fixed = reading.copy()
    fixed.setflags(write=False)
    zeros = np.zeros((6, 2))[:, 1]
    listed = Q.tolist()
    others = [Sample(s.t, listed, zeros, torque.astype(object), fixed) for s in plain]
    expected = [estimate.status for estimate in precise.run(plain)]
    assert [estimate.status for estimate in precise.run(others)] == expected
    assert expected[-1] == "none"


@pytest.mark.parametrize("kind", ["<f4", ">f8", "i8", "O", "pickled", "subclass", "pandas"])
def test_values_of_any_type_are_converted(ordinary: Localizer, kind: str) -> None:
    """Machine code that takes eight bytes for a float would read other numbers."""
    q = np.array([0.0, -1.0, 2.0, -2.0, -1.0, 0.0])
    torque, wrench = weight(ordinary.scene, q)
    torque, wrench = np.round(torque), np.round(wrench + np.array([0.0, 25.0, 0.0, 4.0, 0.0, 0.0]))

    def other(values: np.ndarray) -> np.ndarray:
        if kind == "pickled":
            found: np.ndarray = pickle.loads(pickle.dumps(values))
            return found
        if kind == "pandas":
            return pytest.importorskip("pandas").Series(values)  # type: ignore[no-any-return]
        return values.view(np.recarray) if kind == "subclass" else values.astype(kind)

    expected = ordinary.locate(q, base_wrench=wrench, joint_torque=torque, external=False, detect=False)
    found = ordinary.locate(
        other(q), base_wrench=other(wrench), joint_torque=other(torque), external=False, detect=False
    )
    assert np.linalg.norm(found.wrench) > 20.0
    np.testing.assert_array_equal(found.wrench, expected.wrench)
    samples = [Sample(0.002 * i, q, 0.0 * q, torque, wrench) for i in range(80)]
    others = [Sample(s.t, other(q), other(0.0 * q), other(torque), other(wrench)) for s in samples]
    one, two = list(ordinary.run(samples))[-1], list(ordinary.run(others))[-1]
    assert np.linalg.norm(one.wrench) > 20.0
    np.testing.assert_array_equal(one.wrench, two.wrench)
