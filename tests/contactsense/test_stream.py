"""`step` and `run` on a stream of samples of a held posture."""

import pickle

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
